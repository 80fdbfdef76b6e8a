"""Recorder of a run: one row per control tick, one row per image."""

from collections import deque

import numpy as np

from tautscope.config import Config
from tautscope.loop.construction import build_loop
from tautscope.loop.measurement import Measurement
from tautscope.loop.reduction import Report
from tautscope.loop.rig import Frame, Sample
from tautscope.runs.recording import Floats, Table, per_dof, trace_columns, update_columns

Row = np.void
"""Of a table; its fields are the columns."""
_USED = ("ok", "held", "partial")
"""Status of a measurement that was used."""
_BLOCK = 100
"""Rows converted to an array at a time, which takes a fifth of a millisecond."""
_NO_FEATURES = (np.nan, np.nan, np.nan, np.nan)


def update_row(
    columns: np.dtype[np.void], now: float, seen: Frame | Measurement, report: Report, count: int
) -> Row:
    """Result of an update in `update_columns`; the true state comes later.

    A measurement has the number `count`, a frame its own; `now` is the time of arrival [s].
    """
    features: tuple[float, ...] = ()
    if isinstance(seen, Measurement):
        is_valid = report.status in _USED
    else:
        count, detection = seen.sequence, report.detection
        is_valid = detection is not None and bool(detection.valid)
        found = detection.features if detection is not None and is_valid else _NO_FEATURES
        truth = _NO_FEATURES if seen.true_features is None else seen.true_features
        features = (*found, *report.predicted_features, *report.innovation, *truth)
    facts = report.captured_at, now, count, str(report.status), is_valid
    unknown = (np.nan for _ in report.state_estimate)
    states = *report.state_estimate, *report.predicted_state, *unknown
    row: Row = np.array([(*facts, *states, *report.observable, *features)], columns)[0]
    return row


class _RowBuffer:
    """Rows, converted to arrays in small blocks: one large conversion would block all threads."""

    def __init__(self, columns: np.dtype[np.void], most: int | None) -> None:
        self._columns = columns
        self._packed: deque[Table] = deque(maxlen=None if most is None else most // _BLOCK)
        self._rows: list[Row | tuple[object, ...]] = []

    def append(self, row: Row | tuple[object, ...]) -> None:
        self._rows.append(row)
        if len(self._rows) == _BLOCK:
            self._pack()

    def table(self) -> Table:
        self._pack()
        whole = np.empty(sum(map(len, self._packed)), self._columns)
        end = 0
        for block in self._packed:
            start, end = end, end + len(block)
            whole[start:end] = block
        return whole

    def _pack(self) -> None:
        self._packed.append(np.array(self._rows, dtype=self._columns))
        self._rows = []


class RunRecorder:
    """Collects the rows of a `Recording` in the order of events.

    Until the first update the contact offsets are those with which the loop starts. About the
    newest `most` rows of each table are kept, or all.
    """

    def __init__(self, config: Config, most: int | None = None) -> None:
        self._dofs = config.dofs
        self._columns = update_columns(config)
        self._trace = _RowBuffer(trace_columns(config.dofs), most)
        self._frames = _RowBuffer(self._columns, most)
        self._unknown = (np.nan,) * len(config.dofs)
        self._estimate = self._unknown
        loop = build_loop(config)
        self._deltas = *loop.delta_minus, *loop.delta_plus
        self._status = "none"

    def add_tick(self, sample: Sample, reference: Floats, command: Floats) -> None:
        """Add a control tick: the rig's sample, the reference and the command given then."""
        truth = self._unknown if sample.true_state is None else sample.true_state
        states = *reference, *command, *sample.applied, *self._estimate, *truth
        self._trace.append((sample.time, *states, *self._deltas, self._status))

    def add_update(self, now: float, seen: Frame | Measurement, report: Report, count: int) -> None:
        """Add an update, see `update_row`."""
        row = update_row(self._columns, now, seen, report, count)
        self.add_row(row, report.delta_minus, report.delta_plus)

    def add_row(self, row: Row, delta_minus: Floats, delta_plus: Floats) -> None:
        """Add an update: its `update_row`, and the contact offsets (n,) after it."""
        self._estimate = tuple(row[f"estimate_{dof.label}"] for dof in self._dofs)
        self._deltas = (*delta_minus, *delta_plus)
        self._status = str(row["status"])
        self._frames.append(row)

    def tables(self) -> tuple[Table, Table]:
        """Trace and frames; the frames with the true state at their capture times."""
        trace, frames = self._trace.table(), self._frames.table()
        if len(trace):
            truths = per_dof(trace, "true", self._dofs)
            for dof, truth in zip(self._dofs, truths.T, strict=True):
                frames[f"true_{dof.label}"] = np.interp(
                    frames["captured_at"], trace["time"], truth, left=np.nan, right=np.nan
                )
        return trace, frames
