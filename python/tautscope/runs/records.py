"""Records of actuator and tip positions: reading of tables, and cleaning."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from tautscope.dof import Dof
from tautscope.errors import RecordError
from tautscope.runs.pose_columns import Floats
from tautscope.runs.tables import Sheet, filled, open_table, read_table
from tautscope.runs.units import TIMES, time_scale, units_of

GAP = 10.0
"""A sampling interval above this many medians is a gap."""
SINCE_1970 = 1e8
"""Times above are since 1970, and become those since the first one [s]."""
LONGEST_INTERVAL = 5.0
"""Between samples [s]; a longer one, where nobody named the unit, is another unit."""


@dataclass(frozen=True)
class Cleaning:
    """Counts of what the cleaning of a file removed, moved or found.

    Attributes:
        blank: Removed lines without a time, or whose command is not known.
        interpolated: Lines with a tip whose command was interpolated in time.
        unseen: Kept lines with a command but no tip; they are neither fitted nor scored.
        duplicates: Removed lines whose time, command and tip equal those of an earlier line.
        reordered: Late lines, sorted by time.
        clock_steps: Places where the clock was set back; later times were shifted.
        gaps: Sampling intervals above ten medians. The command is assumed monotonic in a gap; if it
            turned there, every model is wrong until it has reached both contacts again.
        longest_gap: [s], 0 without gaps.
        equal_times: Whether there was a time, but one alone.
    """

    blank: int = 0
    interpolated: int = 0
    unseen: int = 0
    duplicates: int = 0
    reordered: int = 0
    clock_steps: int = 0
    gaps: int = 0
    longest_gap: float = 0.0
    equal_times: bool = False


@dataclass(frozen=True, eq=False)
class Record:
    """Columns of a recorded file, cleaned.

    Attributes:
        command: (n,) actuator position, the user's unit.
        measured: (n,) tip position, the user's unit; NaN where it was not measured.
        time: (n,) [s], never decreasing; None if no column was named, or all times are equal. No
            model of the comparison uses it.
        rows: (n,) line of the file of each sample.
        units: Units of command and measured, as the file names them; empty where it does not.
        time_unit: That of the time, "s" of dates; empty where the file does not name it.
    """

    command: Floats
    measured: Floats
    time: Floats | None
    rows: NDArray[np.int64]
    cleaning: Cleaning
    units: tuple[str, str] = ("", "")
    time_unit: str = ""

    @property
    def is_timed(self) -> bool:
        """Whether there is a time that is new at most samples."""
        return self.time is not None and bool(np.mean(np.diff(self.time) > 0) > 0.5)

    @property
    def clock(self) -> Floats:
        """(n,) time [s], or the numbers of the samples where it is not known."""
        samples = np.arange(len(self.command), dtype=np.float64)
        return self.time if self.is_timed and self.time is not None else samples

    @property
    def clock_unit(self) -> str:
        """Of the `clock`: s or samples."""
        return "s" if self.is_timed else "samples"

    def part(self, samples: slice | NDArray[np.intp]) -> Record:
        """The record of some samples; gaps and other counts stay those of the file."""
        return replace(
            self,
            command=self.command[samples],
            measured=self.measured[samples],
            time=None if self.time is None else self.time[samples],
            rows=self.rows[samples],
        )


def read_record(
    path: str | PathLike[str] | Sheet,
    command: str,
    measured: str,
    time: str | None = None,
    *,
    tip_path: str | PathLike[str] | Sheet | None = None,
    missing: Sequence[float] = (),
) -> Record:
    """Read columns of a CSV or Parquet file, and clean them.

    A blank or NaN cell is a missing value; any other text is an error. A line without a tip is
    kept, because the play moves with its command. At a line without a command, the command is
    interpolated in time between the lines before and after; without a time, or farther apart than
    `GAP`, the line is removed. With a time column, duplicates are removed and lines sorted, see
    `Cleaning`; without one the order of the file is kept.

    Args:
        path: The file, see `tautscope.runs.tables.read_table`; ``-`` is standard input. Or one that
            is open, for several records of it.
        command: Column of the actuator position.
        measured: Column of the tip position.
        time: Column of the time: in the unit of its title, without one in s, or since 1970 by its
            size; or dates or times of day.
        tip_path: File of the tip, with a time of the same clock, if it is not in the first.
        missing: Values that stand for none, such as -9999.

    Raises:
        MissingExtraError: Polars is not installed.
        MissingPathError: The file does not exist.
        RecordError: A column is missing, a cell is not a number, or fewer than two samples have a
            tip; the error names file, line and column.
    """
    tips = sheet = path if isinstance(path, Sheet) else open_table(path)
    if tip_path is None:
        table, rows, units, _ = _read(sheet, (command, measured), time)
    else:
        tips = tip_path if isinstance(tip_path, Sheet) else open_table(tip_path)
        if time is None:
            raise RecordError(tips.file, "no time", "a column of the time in both files")
        motor, motor_rows, motor_units, motor_start = _read(sheet, (command,), time)
        tip, tip_rows, tip_units, tip_start = _read(tips, (measured,), time)
        tip[:, -1] += (tip_start - motor_start) / 1e9  # dates count from the first of each file
        nothing = [np.full((len(each), 1), np.nan) for each in (motor, tip)]
        motor = np.hstack([motor[:, :1], nothing[0], motor[:, 1:]])
        table = np.vstack([motor, np.hstack([nothing[1], tip])])
        order = np.argsort(table[:, 2], kind="stable")
        table, rows = table[order], np.concatenate([motor_rows, tip_rows])[order]
        units = motor_units[:1] + tip_units
    time_unit = "" if time is None else units[-1]
    if time is not None and np.nanmin(table[:, 2]) > SINCE_1970:
        table[:, 2] -= np.floor(np.nanmin(table[:, 2]))
        time_unit = "s"
    table[:, :2][np.isin(table[:, :2], missing)] = np.nan
    is_blank = (
        np.isnan(table[:, 0])
        if time is None
        else (np.isnan(table[:, 2]) | np.isnan(table[:, :2]).all(axis=1))
    )
    table, rows = table[~is_blank], rows[~is_blank]
    for column, (source, name) in enumerate(((sheet, command), (tips, measured))):
        _check_count(source, name, table[:, column], "at least 2")
    record = _clean(table, rows, int(np.count_nonzero(is_blank)))
    allowed = "at least 2 at times at which the command is known: a time of one clock"
    _check_count(tips, measured, record.measured, allowed)
    return replace(record, units=(units[0], units[1]), time_unit=time_unit)


def _check_count(sheet: Sheet, name: str, values: Floats, allowed: str) -> None:
    count = int(np.count_nonzero(np.isfinite(values)))
    if count < 2:
        raise RecordError(f"{sheet.file}, column {name}", f"{count} samples", allowed)


def _read(
    sheet: Sheet, names: tuple[str, ...], time: str | None
) -> tuple[Floats, NDArray[np.int64], tuple[str, ...], int]:
    """Columns, the last one the time [s] if there is one; lines, units, start [ns]."""
    wanted = names if time is None else (*names, time)
    found = sheet.read(wanted)
    table = np.stack([found.columns[name] for name in wanted], axis=1)
    units = tuple(found.units.get(name, "") for name in wanted)
    if time is None:
        return table, found.rows, units, 0
    stamps, unit, where = table[:, -1], units[-1], f"{sheet.file}, column {time}"
    if not np.isfinite(stamps).any():
        raise RecordError(where, "no time", "one in each line")
    if unit and unit not in TIMES:
        raise RecordError(where, f"unit {unit}", f"one of {', '.join(TIMES)}")
    table[:, -1] = stamps * (TIMES[unit] if unit else time_scale(float(np.nanmedian(stamps))))
    return table, found.rows, units, found.starts[time]


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
    if "time" not in named:
        table[:, 0] *= time_scale(float(np.median(table[:, 0])))
    for column, (name, known) in enumerate(zip(names, (TIMES, *map(units_of, Dof)), strict=True)):
        if name in named and named[name] not in known:
            allowed = f"one of {', '.join(known)}; type --units {name}=UNIT"
            raise RecordError(f"{path}, column {name}", f"unit {named[name]}", allowed)
        table[:, column] *= known[named[name]] if name in named else 1.0
    for dof in Dof:
        size = float(np.abs(table[:, 1 + dof]).max())
        if largest is not None and dof.label not in named and size > largest[dof]:
            likely, unit = ("mm", "m") if dof is Dof.INSERTION else ("deg", "rad")
            allowed = (
                f"at most {largest[dof]:.3g} {unit}; if the column is in {likely}, type "
                f"--units {dof.label}={likely}, or write its title as {dof.label}_{likely}"
            )
            raise RecordError(f"{path}, column {dof.label}", f"{size:.4g} {unit}", allowed)
    backward = np.flatnonzero(np.diff(table[:, 0]) <= 0)
    if len(backward):
        line = rows[backward[0] + 1]
        before, after = (float(value) for value in table[backward[0] : backward[0] + 2, 0])
        where = f"{path}, line {line}, column time"
        if after == before:
            count = int(np.count_nonzero(np.diff(table[:, 0]) == 0)) + 1
            got = f"{after:g} again, as in {count} lines of {len(table)}"
            raise RecordError(where, got, "a time of its own for each line: finer time stamps")
        raise RecordError(where, after, f"later than {before}")
    interval = float(np.median(np.diff(table[:, 0]))) if len(table) > 1 else 0.0
    if "time" not in named and interval > LONGEST_INTERVAL:
        allowed = (
            f"at most {LONGEST_INTERVAL:g} s; if the column is in ms, type --units time=ms, or "
            "write its title as time_ms"
        )
        raise RecordError(f"{path}, column time", f"a position every {interval:g} s", allowed)
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
    order, time, reordered, clock_steps = _sort_all(table[kept, 2], table[kept, 0])
    rows, table = rows[kept][order], table[kept][order]
    is_lone = np.isnan(table[:, 0])
    table[:, 0] = _interpolated(time, table[:, 0])
    is_known = np.isfinite(table[:, 0])
    table, rows, time = table[is_known], rows[is_known], time[is_known]
    steps, longest = _steps(time)
    gaps = steps[steps > longest]
    has_time = bool(time[-1] > time[0])
    cleaning = Cleaning(
        blank=blank + int(np.count_nonzero(~is_known)),
        interpolated=int(np.count_nonzero(is_lone & is_known)),
        unseen=int(np.count_nonzero(np.isnan(table[:, 1]))),
        duplicates=duplicates,
        reordered=reordered,
        clock_steps=clock_steps,
        gaps=len(gaps),
        longest_gap=float(gaps.max()) if len(gaps) else 0.0,
        equal_times=not has_time,
    )
    return Record(table[:, 0], table[:, 1], time if has_time else None, rows, cleaning)


def _sort_all(time: Floats, command: Floats) -> tuple[NDArray[np.intp], Floats, int, int]:
    """`_sort` of lines of which some have no command: these are put where their times are."""
    known = np.flatnonzero(np.isfinite(command))
    order, times, reordered, clock_steps = _sort(time[known], command[known])
    if len(known) == len(command):
        return order, times, reordered, clock_steps
    if clock_steps:
        return _sort(time, filled(command))
    lines = np.concatenate([known[order], np.flatnonzero(np.isnan(command))])
    lines = lines[np.argsort(time[lines], kind="stable")]
    return lines, time[lines], reordered, clock_steps


def _steps(time: Floats) -> tuple[Floats, float]:
    """Steps of time, and the longest that is no gap; repeated stamps of a coarse clock are none."""
    steps = np.diff(time)
    later = steps[steps > 0]
    return steps, GAP * float(np.median(later)) if len(later) else 0.0


def _interpolated(time: Floats, command: Floats) -> Floats:
    """The command at every time; NaN before, after, and in its gaps."""
    known = np.flatnonzero(np.isfinite(command))
    if len(known) == len(command):
        return command
    times = time[known]
    found = np.interp(time, times, command[known], left=np.nan, right=np.nan)
    following = np.clip(np.searchsorted(times, time), 1, len(times) - 1)
    steps, longest = _steps(times)
    is_gap = steps[following - 1] > longest
    return np.where(np.isnan(command) & is_gap, np.nan, found)


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
