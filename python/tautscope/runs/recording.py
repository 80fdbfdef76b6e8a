"""The recording of a run: every tick, every frame, and the configuration."""

import csv
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config, dump_config, load_config
from tautscope.dof import Dof, NamedDof
from tautscope.errors import MissingPathError, RecordError
from tautscope.loop.references import Segment
from tautscope.runs.output_folder import new_folder

Floats = NDArray[np.float64]
Table = NDArray[np.void]

FEATURES = ("a_x", "a_y", "b_x", "b_y")
"""The order of every (4,) array of features."""
_FLAGS = {"True": True, "False": False}


def _names(groups: list[str], members: list[str]) -> list[str]:
    return [f"{group}_{member}" for group in groups for member in members]


def trace_columns(dofs: Iterable[NamedDof]) -> np.dtype[np.void]:
    """Columns of a trace with these degrees of freedom."""
    groups = ["reference", "command", "applied", "estimate", "true", "delta_minus", "delta_plus"]
    names = _names(groups, [dof.label for dof in dofs])
    return np.dtype([("time", "f8"), *((name, "f8") for name in names), ("status", "U16")])


def update_columns(config: Config) -> np.dtype[np.void]:
    """Columns of the updates of a run: of a robot with [[dof]] without features."""
    labels = [dof.label for dof in config.dofs]
    features = [] if config.dof else list(FEATURES)
    groups = ["features", "predicted_features", "innovation", "true_features"]
    return np.dtype(
        [("captured_at", "f8"), ("arrived_at", "f8"), ("sequence", "i8")]
        + [("status", "U16"), ("valid", "?")]
        + [(name, "f8") for name in _names(["estimate", "predicted", "true"], labels)]
        + [(name, "?") for name in _names(["observable"], labels)]
        + [(name, "f8") for name in _names(groups, features)]
    )


@dataclass(frozen=True, eq=False)
class Snapshot:
    """One frame of a run and the features measured in it, for a figure.

    Attributes:
        image: uint8 (height, width, 3), BGR.
        captured_at: [s, the rig's clock].
        features: (4,) measured features [px]; NaN for a band not found.
        predicted_features: (4,) [px].
    """

    image: NDArray[np.uint8]
    captured_at: float
    features: Floats
    predicted_features: Floats

    def __repr__(self) -> str:
        height, width = self.image.shape[:2]
        return f"<Snapshot: {width} x {height}, captured at {self.captured_at:.3f} s>"


@dataclass(frozen=True, eq=False)
class Recording:
    """The recording of a run.

    Attributes:
        trace: Structured array, one row per control tick: `time` [s, the rig's clock]; per DOF
            [m or rad] `reference_*`, `command_*` (given at this time), `applied_*` and
            `true_*` (at this time; truth is NaN if the rig has none), `estimate_*`,
            `delta_minus_*`, `delta_plus_*` (after the newest frame); `status` of that frame.
        frames: Structured array, one row per image: `captured_at` (of a measurement its stamp less
            `measurement.delays`), `arrived_at` [s], `sequence`, `status`, `valid`; per DOF
            `estimate_*`, `predicted_*`, `true_*` (at the capture time, interpolated),
            `observable_*`; per feature [px] `features_*`, `predicted_features_*`,
            `innovation_*`, `true_features_*`. Of a robot with [[dof]] a row per measurement,
            without features.
        segments: Which DOF moved when.
        snapshot: One frame from about the middle; not saved.
        warnings: A line for each disabled monitor, and for each flag raised
            (`tautscope.runs.flag_summary`); not saved.
        began: When, if it was read from a log; not saved.
    """

    trace: Table
    frames: Table
    config: Config
    compensated: bool
    segments: tuple[Segment, ...]
    snapshot: Snapshot | None = None
    warnings: tuple[str, ...] = ()
    began: datetime | None = None

    def __repr__(self) -> str:
        time = self.trace["time"]
        seconds = time[-1] - time[0] if len(time) else 0.0
        compensated = "with" if self.compensated else "without"
        return (
            f"<Recording: {len(time)} ticks in {seconds:g} s, {len(self.frames)} updates, "
            f"profile {self.config.profile}, {compensated} compensation>"
        )

    def tracking_rms(self, after: float = 20.0) -> Floats:
        """RMS of the tip less the reference (n,) [m or rad] from `after` [s] on.

        The tip is the true one, or the estimate where the rig does not know it; NaN before the
        first measurement, and for a run that ends before `after`.
        """
        error = self.tracking_error(after)
        if not len(error):
            return np.full(error.shape[1], np.nan)
        rms: Floats = np.sqrt(np.mean(error**2, axis=0))
        return rms

    def tracking_error(self, after: float = 20.0) -> Floats:
        """Tip less reference (ticks, n) [m or rad] from `after` [s] on; see `tracking_rms`."""
        trace, dofs = self.trace, self.config.dofs
        rows = trace["time"] >= trace["time"][0] + after
        true, estimate = (per_dof(trace, group, dofs)[rows] for group in ("true", "estimate"))
        tip = np.where(np.isnan(true), estimate, true)
        error: Floats = tip - per_dof(trace, "reference", dofs)[rows]
        return error

    def during(self, segment: Segment, first: float, last: float) -> NDArray[np.bool_]:
        """(ticks,) rows of the trace in periods `first` to `last` of a segment."""
        return self._between(self.trace["time"], segment, first, last)

    def frames_during(self, segment: Segment, first: float, last: float) -> NDArray[np.bool_]:
        """(frames,) frames captured in periods `first` to `last` of a segment."""
        return self._between(self.frames["captured_at"], segment, first, last)

    def _between(
        self, time: Floats, segment: Segment, first: float, last: float
    ) -> NDArray[np.bool_]:
        start = float(self.trace["time"][0]) + segment.start
        return (time >= start + first * segment.period) & (time <= start + last * segment.period)

    def save(self, folder: str | PathLike[str]) -> None:
        """Make `folder` with trace.csv, frames.csv, recording.toml and config.toml.

        Raises:
            OutputError: The folder is not empty, or cannot be written.
        """
        with new_folder(folder) as place:
            self.write(place)

    def write(self, folder: Path, suffix: str = "") -> None:
        """Write the files of `save` into an existing folder, with a suffix to their names."""
        import tomlkit  # noqa: PLC0415  only writing needs it

        _write_csv(folder / f"trace{suffix}.csv", self.trace)
        _write_csv(folder / f"frames{suffix}.csv", self.frames)
        facts = tomlkit.dumps(run_facts(self.compensated, self.segments))
        (folder / f"recording{suffix}.toml").write_text(facts, encoding="utf-8")
        (folder / "config.toml").write_text(dump_config(self.config), encoding="utf-8")

    @classmethod
    def load(cls, folder: str | PathLike[str], suffix: str = "") -> Self:
        """Read what `save` wrote; equal to the last bit, without snapshot and warnings.

        Raises:
            MissingPathError: A file does not exist.
            RecordError: A file is not as `save` writes it.
        """
        place = Path(folder)
        facts_file = place / f"recording{suffix}.toml"
        if not facts_file.is_file():
            raise MissingPathError("recording", str(facts_file), "a file of a saved recording")
        try:
            facts = facts_file.read_text(encoding="utf-8")
            config = load_config(place / "config.toml")
            compensated, segments = read_run_facts(facts, config)
        except (UnicodeDecodeError, tomllib.TOMLDecodeError, KeyError, TypeError) as error:
            allowed = f"compensated and segments ({error})"
            raise RecordError("recording", str(facts_file), allowed) from None
        trace = _read_csv(place / f"trace{suffix}.csv", trace_columns(config.dofs))
        frames = _read_csv(place / f"frames{suffix}.csv", update_columns(config))
        return cls(trace, frames, config, compensated, segments)


def run_facts(compensated: bool, segments: Iterable[Segment]) -> dict[str, Any]:
    """What configuration and tables do not say of a run, as a TOML document."""
    items = [
        {"dof": each.dof.label, "start": each.start, "period": each.period, "periods": each.periods}
        for each in segments
    ]
    return {"compensated": compensated, "segments": items}


def read_run_facts(text: str, config: Config) -> tuple[bool, tuple[Segment, ...]]:
    """Whether a run was compensated, and its segments, from the text of `run_facts`.

    Raises:
        TOMLDecodeError, KeyError, TypeError: The text is none of `run_facts` for these degrees of
            freedom.
    """
    facts, dofs = tomllib.loads(text), {dof.label: dof for dof in config.dofs}
    segments = []
    for item in facts["segments"]:
        numbers = item["start"], item["period"], item["periods"]
        if not all(isinstance(each, int | float) for each in numbers):
            raise TypeError(f"start, period and periods are numbers, not {numbers}")
        segments.append(Segment(dofs[item["dof"]], *numbers))
    compensated = facts["compensated"]
    if not isinstance(compensated, bool):
        raise TypeError(f"compensated is true or false, not {compensated!r}")
    return compensated, tuple(segments)


def per_dof(table: Table, group: str, dofs: Iterable[NamedDof] = Dof) -> Floats:
    """(rows, n) columns ``<group>_insertion``, ... of a table, one per degree of freedom."""
    return np.stack([table[f"{group}_{dof.label}"] for dof in dofs], axis=1)


def per_feature(table: Table, group: str) -> Floats:
    """(n, 4) columns ``<group>_a_x`` to ``<group>_b_y`` of a table [px]."""
    return np.stack([table[f"{group}_{name}"] for name in FEATURES], axis=1)


def _write_csv(path: Path, table: Table) -> None:
    """Write a structured array as CSV with a header; every number is written in full."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(table.dtype.names or ())
        writer.writerows(table.tolist())


def _read_csv(path: Path, dtype: np.dtype[np.void]) -> Table:
    """Read a file of `_write_csv`; equal to what was written, to the last bit."""
    if not path.is_file():
        raise MissingPathError("recording", str(path), "a file of a saved recording")
    try:
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = list(csv.reader(file)) or [[]]
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordError(str(path), str(error), "a table of a saved recording") from None
    names = dtype.names or ()
    if tuple(header) != names:
        raise RecordError(str(path), ",".join(header), f"the columns {', '.join(names)}")
    table = np.empty(len(rows), dtype)
    try:
        columns = list(zip(*rows, strict=True)) or [()] * len(names)
        for name, column in zip(names, columns, strict=True):
            is_flag = dtype[name].kind == "b"
            table[name] = [_FLAGS[cell] for cell in column] if is_flag else column
    except KeyError as error:
        raise RecordError(f"{path}: {name}", error.args[0], "True or False") from None
    except (ValueError, OverflowError) as error:
        raise RecordError(str(path), str(error), "a number in every cell") from None
    return table
