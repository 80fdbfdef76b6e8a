"""Users import figures of merit from here; the code is in `tautscope.report.metrics`."""

from tautscope.report.metrics import (
    LoopWidth,
    actuator_gain,
    creep,
    loop_width,
    marker_errors,
    marker_rms,
    overshoot,
    peak_to_peak,
    period_widths,
    reduction,
    rms,
    start_periods,
    state_rms,
    tip_overspeed,
    tracking_rms,
    until_within,
)

__all__ = [
    "LoopWidth",
    "actuator_gain",
    "creep",
    "loop_width",
    "marker_errors",
    "marker_rms",
    "overshoot",
    "peak_to_peak",
    "period_widths",
    "reduction",
    "rms",
    "start_periods",
    "state_rms",
    "tip_overspeed",
    "tracking_rms",
    "until_within",
]
