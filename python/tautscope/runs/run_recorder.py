"""Recorder of a run: one row per control tick, one row per image."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.measurement import Measurement
from tautscope.runs.recording import FEATURES, Floats, Table, frame_columns, per_dof, trace_columns

if TYPE_CHECKING:
    from tautscope.loop.reduction import Report
    from tautscope.loop.rig import Frame, Sample

Row = tuple[object, ...]
_UNKNOWN = (np.nan, np.nan, np.nan)
_BLOCK = 100
"""Rows converted to an array at a time, which takes a fifth of a millisecond."""
_NO_FEATURES = (np.nan, np.nan, np.nan, np.nan)


def frame_row(now: float, frame: Frame, report: Report) -> Row:
    """Result of an image update in the order of `FRAME_COLUMNS`; the true state comes later.

    Args:
        now: Time of the frame's arrival [s, the rig's clock].
        frame: The frame.
        report: Its image update.
    """
    detection = report.detection
    valid = detection is not None and bool(detection.valid)
    features = detection.features if detection is not None and valid else _NO_FEATURES
    truth = _NO_FEATURES if frame.true_features is None else frame.true_features
    return (
        frame.captured_at,
        now,
        frame.sequence,
        str(report.status),
        valid,
        *report.state_estimate,
        *report.predicted_state,
        *_UNKNOWN,
        *report.observable,
        *features,
        *report.predicted_features,
        *report.innovation,
        *truth,
    )


def measurement_row(now: float, count: int, measurement: Measurement, report: Report) -> Row:
    """Result of an update by a measurement in the order of `frame_columns` without features."""
    return (
        measurement.captured_at,
        now,
        count,
        str(report.status),
        report.status in ("ok", "held", "partial"),
        *report.state_estimate,
        *report.predicted_state,
        *(np.nan for _ in report.state_estimate),
        *report.observable,
    )


class _RowBuffer:
    """Rows, converted to arrays in small blocks: one large conversion would block all threads."""

    def __init__(self, columns: np.dtype[np.void], most: int | None) -> None:
        self._columns = columns
        self._packed: deque[Table] = deque(maxlen=None if most is None else most // _BLOCK)
        self._rows: list[Row] = []

    def append(self, row: Row) -> None:
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

    Args:
        config: Its contact offsets are recorded until the first frame.
        most: About how many rows of each table are kept, the newest ones; without it all.
    """

    def __init__(self, config: Config, most: int | None = None) -> None:
        self._dofs = config.dofs
        self._columns = frame_columns(config.dofs, () if config.dof else FEATURES)
        self._trace = _RowBuffer(trace_columns(config.dofs), most)
        self._frames = _RowBuffer(self._columns, most)
        self._unknown = (np.nan,) * len(config.dofs)
        self._estimate: Row = self._unknown
        own = config.dof or [config[dof] for dof in Dof]
        self._deltas: Row = (*(dof.delta_minus for dof in own), *(dof.delta_plus for dof in own))
        self._status = "none"

    def add_tick(self, sample: Sample, reference: Floats, command: Floats) -> None:
        """Add a control tick: the rig's sample, the reference and the command given then."""
        truth = self._unknown if sample.true_state is None else sample.true_state
        self._trace.append(
            (
                sample.time,
                *reference,
                *command,
                *sample.applied,
                *self._estimate,
                *truth,
                *self._deltas,
                self._status,
            )
        )

    def add_frame(self, row: Row, delta_minus: Floats, delta_plus: Floats) -> None:
        """Add an image update: its `frame_row`, and the contact offsets (3,) after it."""
        fields = dict(zip(self._columns.names or (), row, strict=True))
        self._estimate = tuple(fields[f"estimate_{dof.label}"] for dof in self._dofs)
        self._deltas = (*delta_minus, *delta_plus)
        self._status = str(fields["status"])
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
