"""Users import figures of merit from here; the code is in `tautscope.report`."""

from tautscope.report.metrics import (
    LoopWidth,
    actuator_gain,
    creep,
    largest_error,
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
from tautscope.report.tracking_bound import tracking_bound

__all__ = [
    "LoopWidth",
    "actuator_gain",
    "creep",
    "largest_error",
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
    "tracking_bound",
    "tracking_rms",
    "until_within",
]
