"""The estimator on a record: any motor position beside any tip position, no camera needed."""

from __future__ import annotations

import csv
import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.dof import Dof
from tautscope.errors import MissingPathError, RecordError, SignalError

if TYPE_CHECKING:
    from tautscope._core import Estimator

Floats = NDArray[np.float64]


GAP = 10.0
"""A distance between two samples above this many medians is a gap."""


@dataclass(frozen=True)
class Cleaning:
    """What was done to the lines of a file, so that nothing is done silently.

    Attributes:
        blank: Lines left out: no command, or no time, in them.
        unseen: Lines kept with a command but no tip: nothing is learnt from or scored on them.
        duplicates: Lines left out: time, command and tip are those of an earlier line.
        reordered: Lines put where their time says.
        clock_steps: Places where the clock was set back: order kept, later times shifted.
        gaps: Distances in time above ten medians. The command is taken to have gone straight
            across; if it turned there, every model is wrong until both contacts were met again.
        longest_gap: [s], 0 without gaps.
    """

    blank: int = 0
    unseen: int = 0
    duplicates: int = 0
    reordered: int = 0
    clock_steps: int = 0
    gaps: int = 0
    longest_gap: float = 0.0


@dataclass(frozen=True, eq=False)
class Record:
    """Columns of a recorded file, cleaned.

    Attributes:
        command: (n,) actuator position, the user's unit.
        measured: (n,) tip position, the user's unit; NaN where it was not seen.
        time: (n,) [s], never falling, if it was asked for; no model reads it.
        rows: (n,) line of the file each sample is from.
        cleaning: What was left out or put right.
    """

    command: Floats
    measured: Floats
    time: Floats | None
    rows: NDArray[np.int64]
    cleaning: Cleaning


def predict_tip(
    command: ArrayLike, measured: ArrayLike, estimator: Estimator
) -> tuple[Floats, Floats, Floats]:
    """What the hysteresis model says about the tip before the tip is seen.

    Runs Eqs. (1) and (4)-(6) over a record in its order: each sample is predicted first, from the
    command so far and the offsets learnt from earlier samples, and learnt from afterwards.
    Sampling may be uneven: nothing here depends on time.

    Args:
        command: (n,) actuator position, any unit.
        measured: (n,) tip position, in the same unit and with a scale of one: an actuator that
            moves by 1 in contact moves the tip by 1.
        estimator: A fresh one: it learns, and would go on from what it knows.

    Returns:
        predicted (n,), delta_minus (n,), delta_plus (n,). Causal: ``predicted[k]`` uses
        ``command[:k + 1]`` and ``measured[:k]`` only. The offsets are those after sample k.

    Raises:
        SignalError: Not two signals of the same length of finite numbers.
    """
    command = _signal("command", command)
    measured = _signal("measured", measured)
    if len(command) != len(measured):
        allowed = f"as many as command: {len(command)}"
        raise SignalError("measured", f"{len(measured)} samples", allowed)
    predicted, delta_minus, delta_plus = estimator.run(command, measured)
    return predicted, delta_minus, delta_plus


def read_record(
    path: str | PathLike[str], command: str, measured: str, time: str | None = None
) -> Record:
    """Read columns of a CSV file with a header line, and clean them.

    Blank and NaN are what loggers write where a sensor had no news. A line without a command is
    left out; one without a tip is kept, because the command says how the slack was crossed
    meanwhile. Any other text is an error. With a time column, duplicates are left out and lines
    put in order, see `Cleaning`; without one the file's order is taken as it is.

    Raises:
        MissingPathError: There is no such file.
        RecordError: A column is not there, a cell is not a number, or fewer than two samples with
            a tip are left; the error names file, line and column.
    """
    file = Path(path)
    names = [command, measured] + ([] if time is None else [time])
    samples: list[list[float]] = []
    rows: list[int] = []
    blank = 0
    for number, values in _lines(file, names):
        if any(math.isnan(value) for value in values[:1] + values[2:]):
            blank += 1
            continue
        samples.append(values)
        rows.append(number)
    table = np.array(samples).reshape(-1, len(names))
    seen = int(np.count_nonzero(np.isfinite(table[:, 1])))
    if seen < 2:
        raise RecordError(str(file), f"{seen} samples", "at least 2")
    return _cleaned(table, np.array(rows, dtype=np.int64), blank)


def read_motors(path: str | PathLike[str]) -> tuple[Floats, Floats]:
    """Read motor positions: a CSV file with columns time, insertion, rotation and bending.

    Returns:
        Time (n,) [s], rising, and positions (n, 3) [m, rad, rad]. Lines with a blank cell are left
        out.

    Raises:
        MissingPathError: There is no such file.
        RecordError: A column is not there, a cell is not a number, the time does not rise, or no
            line is left; the error names file, line and column.
    """
    file = Path(path)
    table: list[list[float]] = []
    for number, values in _lines(file, ["time", *(dof.label for dof in Dof)]):
        if any(math.isnan(value) for value in values):
            continue
        if table and values[0] <= table[-1][0]:
            raise RecordError(
                f"{file}, line {number}, column time", values[0], f"later than {table[-1][0]}"
            )
        table.append(values)
    if not table:
        raise RecordError(str(file), "no line with all columns", "at least one")
    array = np.array(table)
    return array[:, 0], array[:, 1:]


def _lines(file: Path, names: Sequence[str]) -> Iterator[tuple[int, list[float]]]:
    """Number and cells of each line, NaN where blank, of a CSV file with a header line."""
    try:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.reader(stream)
            header = [name.strip() for name in next(reader, [])]
            places = [_column(file, header, name) for name in names]
            for line in reader:
                if line:
                    yield reader.line_num, _numbers(file, reader.line_num, line, places, names)
    except (FileNotFoundError, IsADirectoryError):
        raise MissingPathError("record", str(file), "a CSV file with a header line") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordError(str(file), str(error), "a CSV file with a header line") from None


def _cleaned(table: Floats, rows: NDArray[np.int64], blank: int) -> Record:
    """A record from columns command, measured and, if there is one, time."""
    if table.shape[1] == 2:
        unseen = int(np.count_nonzero(np.isnan(table[:, 1])))
        return Record(table[:, 0], table[:, 1], None, rows, Cleaning(blank=blank, unseen=unseen))
    comparable = np.where(np.isnan(table), np.inf, table)  # NaN equals nothing, itself included
    kept = np.sort(np.unique(comparable, axis=0, return_index=True)[1])
    duplicates = len(table) - len(kept)
    order, time, reordered, clock_steps = _in_order(table[kept, 2], table[kept, 0])
    rows, table = rows[kept][order], table[kept][order]
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    gaps = steps[steps > GAP * usual]
    cleaning = Cleaning(
        blank=blank,
        unseen=int(np.count_nonzero(np.isnan(table[:, 1]))),
        duplicates=duplicates,
        reordered=reordered,
        clock_steps=clock_steps,
        gaps=len(gaps),
        longest_gap=float(gaps.max()) if len(gaps) else 0.0,
    )
    return Record(table[:, 0], table[:, 1], time, rows, cleaning)


def _in_order(time: Floats, command: Floats) -> tuple[NDArray[np.intp], Floats, int, int]:
    """Order of samples, their times in that order, lines moved, and times the clock was set back.

    Time that runs backwards has two causes: lines written late, and a clock set back. Where it
    does, the samples between the line that came too early and the one that is past it again are
    put in the order of time if the command then travels no farther; otherwise the clock was set.
    """
    order, time = np.arange(len(time)), time.copy()
    usual = float(np.median(np.abs(np.diff(time))))
    reordered = clock_steps = 0
    backward = np.flatnonzero(np.diff(time) < 0)
    while len(backward):
        late = int(backward[0]) + 1
        past = np.flatnonzero(time[late:] > time[late - 1])
        end = late + int(past[0]) if len(past) else len(time)
        begin = int(np.searchsorted(time[:late], time[late:end].min(), side="right"))
        block = slice(begin, end)
        by_time = begin + np.argsort(time[block], kind="stable")
        around = slice(max(begin - 1, 0), end + 1)
        sorted_order = order.copy()
        sorted_order[block] = order[by_time]
        travels = [np.abs(np.diff(command[way[around]])).sum() for way in (sorted_order, order)]
        if travels[0] <= travels[1]:
            reordered += _moved(by_time)
            order, time[block] = sorted_order, time[by_time]
        else:
            clock_steps += 1
            time[late:] += time[late - 1] - time[late] + usual
        backward = np.flatnonzero(np.diff(time) < 0)
    return order, time, reordered, clock_steps


def _moved(by_time: NDArray[np.intp]) -> int:
    """Fewest lines that have to move: all but the longest rising run through the block."""
    tails: list[int] = []
    for place in by_time.tolist():
        at = bisect_left(tails, place)
        tails[at : at + 1] = [place]
    return len(by_time) - len(tails)


def _signal(name: str, values: ArrayLike) -> Floats:
    signal = np.ascontiguousarray(values, dtype=np.float64)
    if signal.ndim != 1:
        raise SignalError(name, f"an array of shape {signal.shape}", "a signal of shape (n,)")
    bad = np.flatnonzero(~np.isfinite(signal))
    if len(bad):
        raise SignalError(f"{name}[{bad[0]}]", float(signal[bad[0]]), "a finite number")
    return signal


def _column(file: Path, header: Sequence[str], name: str) -> int:
    found = [place for place, title in enumerate(header) if title == name.strip()]
    if len(found) != 1:
        what = "no such column" if not found else f"{len(found)} columns of this name"
        known = f"the header has {', '.join(header)}" if header else "there is no header"
        raise RecordError(f"{file}: {name}", what, f"one; {known}")
    return found[0]


def _numbers(
    file: Path, number: int, line: Sequence[str], places: Sequence[int], names: Sequence[str]
) -> list[float]:
    """The cells of a line as numbers, NaN where blank."""
    values = []
    for place, name in zip(places, names, strict=True):
        text = line[place].strip() if place < len(line) else ""
        try:
            value = float(text) if text else math.nan
        except ValueError:
            value = math.inf
        if math.isinf(value):
            where = f"{file}, line {number}, column {name}"
            raise RecordError(where, text, "a finite number, or blank or NaN for none")
        values.append(value)
    return values
