"""What the compensation of a run without an end achieved in the last minutes."""

import math

import numpy as np

from tautscope.config import Config
from tautscope.loop.measurement import Measurement
from tautscope.loop.reduction import Report
from tautscope.loop.rig import Frame, Sample
from tautscope.report.operator_motion import OperatorResults, evaluate_operator_motion
from tautscope.runs.recording import Floats, Recording
from tautscope.runs.run_recorder import RunRecorder

WINDOW = 120.0
"""Duration of the ticks that are kept, with and without compensation each [s]."""


class Achieved:
    """Records the last `WINDOW` of ticks with all compensation, and of those without any."""

    def __init__(self, config: Config) -> None:
        self._config, self._updates = config, 0
        most = round(WINDOW / config.control.period)
        self._recorders = {share: RunRecorder(config, most) for share in (0.0, 1.0)}
        self._share, self._since = math.nan, math.inf

    def add_tick(self, sample: Sample, reference: Floats, command: Floats, share: float) -> None:
        """Add a tick with a share of the compensation, 0 to 1."""
        if share != self._share:
            self._share, self._since = share, sample.time
        if share in self._recorders:
            self._recorders[share].add_tick(sample, reference, command)

    def add_update(self, now: float, source: Frame | Measurement, report: Report) -> None:
        """Add an update by an image or a measurement that arrived at `now` [s]."""
        self._updates += 1
        # What was captured earlier shows the tip with another share.
        if self._share in self._recorders and source.captured_at >= self._since:
            self._recorders[self._share].add_update(now, source, report, self._updates)

    def results(self) -> OperatorResults:
        """Of each degree of freedom; none where the tip was not measured with compensation."""
        without, with_it = (
            Recording(*recorder.tables(), self._config, share > 0, ())
            for share, recorder in self._recorders.items()
        )
        if not _is_measured(with_it):
            return {}
        first = without if _is_measured(without) else None
        return evaluate_operator_motion(first, with_it, has_bound=False)


def achieved_text(results: OperatorResults) -> str:
    """One line with the figures of each degree of freedom."""
    parts = []
    for dof, result in results.items():
        scale, unit = dof.display_scale, dof.display_unit
        before = result.uncompensated_rms
        known = "" if np.isnan(before) else f", {scale * before:.3g} without compensation"
        parts.append(
            f"{dof.label} {scale * result.compensated_rms:.3g} {unit}{known}, "
            f"slack found {scale * result.slack:.3g} {unit}"
        )
    return "Tip less reference, RMS: " + "; ".join(parts)


def _is_measured(recording: Recording) -> bool:
    """Whether the tip is known in the part of a recording that is evaluated."""
    return len(recording.trace) > 1 and bool(np.isfinite(recording.tracking_error(0.0)[-1]).all())
