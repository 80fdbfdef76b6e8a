"""What a run leaves behind: every tick, every frame, and the configuration they came from."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import tomli_w
from numpy.typing import NDArray

from tautscope.config import Config, dump_config, load_config
from tautscope.dof import Dof
from tautscope.errors import MissingPathError, RecordError
from tautscope.output import new_folder
from tautscope.references import Segment
from tautscope.table_files import read_csv, write_csv

if TYPE_CHECKING:
    from tautscope.reduction import Report
    from tautscope.rig import Frame, Sample

Floats = NDArray[np.float64]
Table = NDArray[np.void]

FEATURES = ("a_x", "a_y", "b_x", "b_y")
"""The order of every (4,) array of features."""


def _names(groups: list[str], members: list[str]) -> list[str]:
    return [f"{group}_{member}" for group in groups for member in members]


_DOFS = [dof.label for dof in Dof]
TRACE_COLUMNS = np.dtype(
    [("time", "f8")]
    + [
        (name, "f8")
        for name in _names(
            ["reference", "command", "applied", "estimate", "true", "delta_minus", "delta_plus"],
            _DOFS,
        )
    ]
    + [("status", "U16")]
)
FRAME_COLUMNS = np.dtype(
    [("captured_at", "f8"), ("arrived_at", "f8"), ("sequence", "i8")]
    + [("status", "U16"), ("valid", "?")]
    + [(name, "f8") for name in _names(["estimate", "predicted", "true"], _DOFS)]
    + [(name, "?") for name in _names(["observable"], _DOFS)]
    + [
        (name, "f8")
        for name in _names(
            ["features", "predicted_features", "innovation", "true_features"], list(FEATURES)
        )
    ]
)


@dataclass(frozen=True, eq=False)
class Snapshot:
    """One frame of a run and what the vision measured in it, for a figure.

    Attributes:
        image: uint8 (height, width, 3), BGR.
        captured_at: [s, the rig's clock].
        features: (4,) measured features [px]; NaN if they were not found.
        predicted_features: (4,) [px].
    """

    image: NDArray[np.uint8]
    captured_at: float
    features: Floats
    predicted_features: Floats


@dataclass(frozen=True, eq=False)
class Recording:
    """A run.

    Attributes:
        trace: Structured array, one row per control tick: `time` [s, the rig's clock]; per DOF
            [m, rad, rad] `reference_*`, `command_*` (given at this time), `applied_*` and
            `true_*` (at this time; truth is NaN if the rig has none), `estimate_*`,
            `delta_minus_*`, `delta_plus_*` (of the newest frame); `status` of that frame.
        frames: Structured array, one row per image: `captured_at`, `arrived_at` [s], `sequence`,
            `status`, `valid`; per DOF `estimate_*`, `predicted_*`, `true_*` (at the capture time,
            interpolated), `observable_*`; per feature [px] `features_*`, `predicted_features_*`,
            `innovation_*`, `true_features_*`.
        config: As used.
        compensated: Whether the compensator was on.
        segments: Which DOF moved when.
        snapshot: One frame from about the middle; not saved.
        warnings: A line for each guard that noticed something, `tautscope.noticed`, and for each
            that is off; not saved.
    """

    trace: Table
    frames: Table
    config: Config
    compensated: bool
    segments: tuple[Segment, ...]
    snapshot: Snapshot | None = None
    warnings: tuple[str, ...] = ()

    def during(self, segment: Segment, first: float, last: float) -> NDArray[np.bool_]:
        """(ticks,) which rows of the trace lie in periods `first` to `last` of a segment."""
        return _between(self.trace["time"], self._clock(segment), segment, first, last)

    def frames_during(self, segment: Segment, first: float, last: float) -> NDArray[np.bool_]:
        """(frames,) which frames were captured in periods `first` to `last` of a segment."""
        return _between(self.frames["captured_at"], self._clock(segment), segment, first, last)

    def _clock(self, segment: Segment) -> float:
        return float(self.trace["time"][0]) + segment.start

    def save(self, folder: str | PathLike[str]) -> None:
        """Make `folder` with trace.csv, frames.csv, recording.toml and config.toml, or nothing.

        Raises:
            OutputError: The folder holds something already, or cannot be written.
        """
        with new_folder(folder) as place:
            self.write(place)

    def write(self, folder: Path, suffix: str = "") -> None:
        """Write the files of `save` into a folder that is there; `suffix` goes on their names."""
        write_csv(folder / f"trace{suffix}.csv", self.trace)
        write_csv(folder / f"frames{suffix}.csv", self.frames)
        segments = [
            {
                "dof": segment.dof.label,
                "start": segment.start,
                "period": segment.period,
                "periods": segment.periods,
            }
            for segment in self.segments
        ]
        facts = tomli_w.dumps({"compensated": self.compensated, "segments": segments})
        (folder / f"recording{suffix}.toml").write_text(facts, encoding="utf-8")
        (folder / "config.toml").write_text(dump_config(self.config), encoding="utf-8")

    @classmethod
    def load(cls, folder: str | PathLike[str], suffix: str = "") -> Recording:
        """Read what `save` wrote; equal to the last bit, but without the snapshot.

        Raises:
            MissingPathError: A file is not there.
            RecordError: A file is not as `save` writes it.
        """
        place = Path(folder)
        facts_file = place / f"recording{suffix}.toml"
        if not facts_file.is_file():
            raise MissingPathError("recording", str(facts_file), "a file of a saved recording")
        try:
            facts = tomllib.loads(facts_file.read_text(encoding="utf-8"))
            segments = tuple(
                Segment(Dof[item["dof"].upper()], item["start"], item["period"], item["periods"])
                for item in facts["segments"]
            )
            compensated = bool(facts["compensated"])
        except (tomllib.TOMLDecodeError, KeyError, TypeError, AttributeError) as error:
            allowed = f"compensated and segments ({error})"
            raise RecordError("recording", str(facts_file), allowed) from None
        return cls(
            trace=read_csv(place / f"trace{suffix}.csv", TRACE_COLUMNS),
            frames=read_csv(place / f"frames{suffix}.csv", FRAME_COLUMNS),
            config=load_config(place / "config.toml"),
            compensated=compensated,
            segments=segments,
        )


Row = tuple[object, ...]
_UNKNOWN = (np.nan, np.nan, np.nan)
_BLOCK = 500
"""Rows packed at once: a millisecond."""
_NO_FEATURES = (np.nan, np.nan, np.nan, np.nan)


def frame_row(now: float, frame: Frame, report: Report) -> Row:
    """What became of a frame, in the order of `FRAME_COLUMNS`; the true state is filled in later.

    Args:
        now: When the frame arrived [s, the rig's clock].
        frame: As it arrived.
        report: What the loop made of it.
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


class _Rows:
    """Rows as they come, packed a few at a time: all at once would hold up every thread."""

    def __init__(self, columns: np.dtype[np.void]) -> None:
        self._columns = columns
        self._packed: list[Table] = []
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


class Tables:
    """The rows of a `Recording`, collected in the order in which things happened.

    Args:
        config: Its contact offsets are those before the first frame.
    """

    def __init__(self, config: Config) -> None:
        self._trace = _Rows(TRACE_COLUMNS)
        self._frames = _Rows(FRAME_COLUMNS)
        self._estimate: Row = _UNKNOWN
        self._deltas: Row = (
            *(config[dof].delta_minus for dof in Dof),
            *(config[dof].delta_plus for dof in Dof),
        )
        self._status = "none"

    def tick(self, sample: Sample, reference: Floats, command: Floats) -> None:
        """One control tick: what the rig said, and what was asked of it then."""
        truth = _UNKNOWN if sample.true_state is None else sample.true_state
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

    def frame(self, row: Row, delta_minus: Floats, delta_plus: Floats) -> None:
        """One image: its `frame_row`, and the offsets (3,) after it."""
        known = dict(zip(FRAME_COLUMNS.names or (), row, strict=True))
        self._estimate = tuple(known[f"estimate_{dof.label}"] for dof in Dof)
        self._deltas = (*delta_minus, *delta_plus)
        self._status = str(known["status"])
        self._frames.append(row)

    def tables(self) -> tuple[Table, Table]:
        """Trace and frames, with the true state at the time of capture."""
        trace, frames = self._trace.table(), self._frames.table()
        if len(trace):
            for dof, truth in zip(Dof, per_dof(trace, "true").T, strict=True):
                frames[f"true_{dof.label}"] = np.interp(
                    frames["captured_at"], trace["time"], truth, left=np.nan, right=np.nan
                )
        return trace, frames


def per_dof(table: Table, group: str) -> Floats:
    """(n, 3) the columns ``<group>_insertion``, ``_rotation``, ``_bending`` of a table."""
    return np.stack([table[f"{group}_{dof.label}"] for dof in Dof], axis=1)


def per_feature(table: Table, group: str) -> Floats:
    """(n, 4) the columns ``<group>_a_x`` to ``<group>_b_y`` of a table [px]."""
    return np.stack([table[f"{group}_{name}"] for name in FEATURES], axis=1)


def _between(
    time: Floats, start: float, segment: Segment, first: float, last: float
) -> NDArray[np.bool_]:
    return (time >= start + first * segment.period) & (time <= start + last * segment.period)
