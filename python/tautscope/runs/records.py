"""Records of actuator and tip positions: reading of tables, and cleaning."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import dataclass, replace
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from tautscope.dof import Dof
from tautscope.errors import RecordError
from tautscope.runs.tables import read_table
from tautscope.runs.units import TIMES, units_of

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
        units: Units of command and measured, as the file names them; empty where it does not.
    """

    command: Floats
    measured: Floats
    time: Floats | None
    rows: NDArray[np.int64]
    cleaning: Cleaning
    units: tuple[str, str] = ("", "")


def read_record(
    path: str | PathLike[str], command: str, measured: str, time: str | None = None
) -> Record:
    """Read columns of a CSV or Parquet file, and clean them.

    A blank or NaN cell is a missing value. A line without a command is removed; one without a tip
    is kept, because the play moves with its command. Any other text is an error. With a time
    column, duplicates are removed and lines sorted, see `Cleaning`; without one the order of the
    file is kept.

    Args:
        path: The file, see `tautscope.runs.tables.read_table`; ``-`` is standard input.
        command: Column of the actuator position.
        measured: Column of the tip position.
        time: Column of the time, in s or the unit of its title, or ISO 8601.

    Raises:
        MissingExtraError: Polars is not installed.
        MissingPathError: The file does not exist.
        RecordError: A column is missing, a cell is not a number, or fewer than two samples have a
            tip; the error names file, line and column.
    """
    names = [command, measured] + ([] if time is None else [time])
    found = read_table(path, names)
    table = np.stack([found.columns[name] for name in names], axis=1)
    if time is not None:
        table[:, 2] *= TIMES.get(found.units.get(time, "s"), 1.0)
    is_blank = np.isnan(np.delete(table, 1, axis=1)).any(axis=1)
    table, rows = table[~is_blank], found.rows[~is_blank]
    count = int(np.count_nonzero(np.isfinite(table[:, 1])))
    if count < 2:
        raise RecordError(str(path), f"{count} samples", "at least 2")
    units = found.units.get(command, ""), found.units.get(measured, "")
    return replace(_clean(table, rows, int(np.count_nonzero(is_blank))), units=units)


def read_motors(
    path: str | PathLike[str], units: Mapping[str, str] | None = None, largest: Floats | None = None
) -> tuple[Floats, Floats]:
    """Read motor positions: a CSV or Parquet file with time, insertion, rotation and bending.

    The unit of a column is the given one, else that of its title (``insertion [mm]``,
    ``bending_deg``) or of a line of units, else s, m, rad, rad.

    Args:
        path: The file, see `tautscope.runs.tables.read_table`; ``-`` is standard input.
        units: Column -> unit, `tautscope.runs.units.parse_units`.
        largest: (3,) [m, rad, rad] magnitude above which positions whose unit nobody named are
            implausible.

    Returns:
        Time (n,) [s], increasing, and positions (n, 3) [m, rad, rad]. Lines with a blank cell are
        skipped.

    Raises:
        MissingExtraError: Polars is not installed.
        MissingPathError: The file does not exist.
        RecordError: A column is missing, a cell is not a number, the time does not increase, a
            unit is implausible, or no line is complete; the error names file, line and column.
    """
    names = ["time", *(dof.label for dof in Dof)]
    found = read_table(path, names, "motor positions")
    named = found.units | dict(units or {})
    table = np.stack([found.columns[name] for name in names], axis=1)
    is_complete = ~np.isnan(table).any(axis=1)
    table, rows = table[is_complete], found.rows[is_complete]
    if not len(table):
        raise RecordError(str(path), "no line with all columns", "at least one")
    for column, (name, known) in enumerate(zip(names, (TIMES, *map(units_of, Dof)), strict=True)):
        if name in named and named[name] not in known:
            allowed = f"one of {', '.join(known)}; type --units {name}=UNIT"
            raise RecordError(f"{path}, column {name}", f"unit {named[name]}", allowed)
        table[:, column] *= known[named[name]] if name in named else 1.0
    for dof in Dof:
        size = float(np.abs(table[:, 1 + dof]).max())
        if largest is not None and dof.label not in named and size > largest[dof]:
            likely, unit = ("mm", "m") if dof is Dof.INSERTION else ("deg", "rad")
            raise RecordError(
                f"{path}, column {dof.label}",
                f"{size:.4g} {unit}",
                f"at most {largest[dof]:.3g} {unit}; if the column is in {likely}, type "
                f"--units {dof.label}={likely}, or write its title as {dof.label}_{likely}",
            )
    backward = np.flatnonzero(np.diff(table[:, 0]) <= 0)
    if len(backward):
        line = rows[backward[0] + 1]
        before, after = (float(value) for value in table[backward[0] : backward[0] + 2, 0])
        raise RecordError(f"{path}, line {line}, column time", after, f"later than {before}")
    return table[:, 0], table[:, 1:]


def _clean(table: Floats, rows: NDArray[np.int64], blank: int) -> Record:
    """A record from the columns command, measured and optionally time."""
    if table.shape[1] == 2:
        unseen = int(np.count_nonzero(np.isnan(table[:, 1])))
        return Record(table[:, 0], table[:, 1], None, rows, Cleaning(blank=blank, unseen=unseen))
    if np.all(np.diff(table[:, 2]) > 0):
        kept = np.arange(len(table))
    else:
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
