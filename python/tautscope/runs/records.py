"""Records of actuator and tip positions: reading of CSV files, and cleaning."""

from __future__ import annotations

import csv
import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tautscope.dof import Dof
from tautscope.errors import MissingPathError, RecordError

Floats = NDArray[np.float64]

GAP = 10.0
"""A sampling interval above this many medians is a gap."""


@dataclass(frozen=True)
class Cleaning:
    """Counts of what the cleaning of a file removed, moved or found.

    Attributes:
        blank: Removed lines without a command or time.
        unseen: Kept lines with a command but no tip; they are neither fitted nor scored.
        duplicates: Removed lines whose time, command and tip equal those of an earlier line.
        reordered: Late lines, sorted by time.
        clock_steps: Places where the clock was set back; later times were shifted.
        gaps: Sampling intervals above ten medians. The command is assumed monotonic in a gap; if it
            turned there, every model is wrong until it has reached both contacts again.
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
        measured: (n,) tip position, the user's unit; NaN where it was not measured.
        time: (n,) [s], never decreasing, if a column was named; no model uses it.
        rows: (n,) line of the file of each sample.
        cleaning: What the cleaning did.
    """

    command: Floats
    measured: Floats
    time: Floats | None
    rows: NDArray[np.int64]
    cleaning: Cleaning


def read_record(
    path: str | PathLike[str], command: str, measured: str, time: str | None = None
) -> Record:
    """Read columns of a CSV file with a header line, and clean them.

    A blank or NaN cell is a missing value. A line without a command is removed; one without a tip
    is kept, because the play moves with its command. Any other text is an error. With a time
    column, duplicates are removed and lines sorted, see `Cleaning`; without one the order of the
    file is kept.

    Raises:
        MissingPathError: The file does not exist.
        RecordError: A column is missing, a cell is not a number, or fewer than two samples have a
            tip; the error names file, line and column.
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
    count = int(np.count_nonzero(np.isfinite(table[:, 1])))
    if count < 2:
        raise RecordError(str(file), f"{count} samples", "at least 2")
    return _clean(table, np.array(rows, dtype=np.int64), blank)


def read_motors(path: str | PathLike[str]) -> tuple[Floats, Floats]:
    """Read motor positions: a CSV file with columns time, insertion, rotation and bending.

    Returns:
        Time (n,) [s], increasing, and positions (n, 3) [m, rad, rad]. Lines with a blank cell are
        skipped.

    Raises:
        MissingPathError: The file does not exist.
        RecordError: A column is missing, a cell is not a number, the time does not increase, or no
            line is complete; the error names file, line and column.
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
            columns = [_column(file, header, name) for name in names]
            for line in reader:
                if line:
                    yield reader.line_num, _numbers(file, reader.line_num, line, columns, names)
    except (FileNotFoundError, IsADirectoryError):
        raise MissingPathError("record", str(file), "a CSV file with a header line") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordError(str(file), str(error), "a CSV file with a header line") from None


def _clean(table: Floats, rows: NDArray[np.int64], blank: int) -> Record:
    """A record from the columns command, measured and optionally time."""
    if table.shape[1] == 2:
        unseen = int(np.count_nonzero(np.isnan(table[:, 1])))
        return Record(table[:, 0], table[:, 1], None, rows, Cleaning(blank=blank, unseen=unseen))
    comparable = np.where(np.isnan(table), np.inf, table)  # NaN does not equal itself
    kept = np.sort(np.unique(comparable, axis=0, return_index=True)[1])
    duplicates = len(table) - len(kept)
    order, time, reordered, clock_steps = _sort(table[kept, 2], table[kept, 0])
    rows, table = rows[kept][order], table[kept][order]
    steps = np.diff(time)
    median = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    gaps = steps[steps > GAP * median]
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


def _sort(time: Floats, command: Floats) -> tuple[NDArray[np.intp], Floats, int, int]:
    """Order of samples, their times, number of moved lines, and number of clock steps.

    Time decreases because lines were written late, or because the clock was set back. The samples
    concerned are sorted by time if the command then travels no farther; otherwise the clock was
    set back, and later times are shifted.
    """
    order, time = np.arange(len(time)), time.copy()
    interval = float(np.median(np.abs(np.diff(time))))
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
        travels = [np.abs(np.diff(command[each[around]])).sum() for each in (sorted_order, order)]
        if travels[0] <= travels[1]:
            reordered += _count_moved(by_time)
            order, time[block] = sorted_order, time[by_time]
        else:
            clock_steps += 1
            time[late:] += time[late - 1] - time[late] + interval
        backward = np.flatnonzero(np.diff(time) < 0)
    return order, time, reordered, clock_steps


def _count_moved(by_time: NDArray[np.intp]) -> int:
    """Least number of lines that must move: all but the longest increasing subsequence."""
    tails: list[int] = []
    for index in by_time.tolist():
        at = bisect_left(tails, index)
        tails[at : at + 1] = [index]
    return len(by_time) - len(tails)


def _column(file: Path, header: Sequence[str], name: str) -> int:
    matches = [index for index, title in enumerate(header) if title == name.strip()]
    if len(matches) != 1:
        what = "no such column" if not matches else f"{len(matches)} columns of this name"
        known = f"the header has {', '.join(header)}" if header else "there is no header"
        raise RecordError(f"{file}: {name}", what, f"one; {known}")
    return matches[0]


def _numbers(
    file: Path, number: int, line: Sequence[str], columns: Sequence[int], names: Sequence[str]
) -> list[float]:
    """The named cells of a line as numbers, NaN where blank."""
    values = []
    for column, name in zip(columns, names, strict=True):
        text = line[column].strip() if column < len(line) else ""
        try:
            value = float(text) if text else math.nan
        except ValueError:
            value = math.inf
        if math.isinf(value):
            where = f"{file}, line {number}, column {name}"
            raise RecordError(where, text, "a finite number, or blank or NaN for none")
        values.append(value)
    return values
