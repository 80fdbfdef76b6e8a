"""Columns of recorded tables: CSV, Parquet, arrays, bags, standard input; with Polars."""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tautscope.errors import MissingPathError, RecordError
from tautscope.extras import require_module
from tautscope.runs import bags
from tautscope.runs.array_files import first_line, read_arrays, with_single_numbers
from tautscope.runs.pose_columns import Floats, find_axes, title_of, travel, turn
from tautscope.runs.table_text import split_table
from tautscope.runs.units import check_unit, split_unit

if TYPE_CHECKING:
    import polars as pl

STDIN = "-"
_POINT = re.compile("/(position|translation|point)/[xyz]$")
"""Columns of a bag in m."""


@dataclass(frozen=True, eq=False)
class Table:
    """Numeric columns of a table.

    Attributes:
        columns: Name as asked for -> (n,) values; NaN where there is none. Times of day and dates
            are seconds since the first one.
        units: Name as asked for -> unit of the header or the line of units, if there is one; s of
            times of day and dates.
        starts: Name as asked for -> the first date or time of day [ns]; 0 of other columns.
        rows: (n,) line of a CSV file, from 1 on; of other files the row, from 1 on.
    """

    columns: dict[str, Floats]
    units: dict[str, str]
    starts: dict[str, int]
    rows: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Sheet:
    """A table whose cells are not read yet.

    Attributes:
        frame: Columns of text, or of Parquet and arrays as they are, in the order of the file.
        titles: Of the columns; their numbers if there is no title row.
        groups: Titles above the titles, or none.
        units: Of a line of units, or none.
        rows: See `Table`.
        line: What a row is called: "line", "row" or "message".
        is_merged: Whether a row has values in the columns of one topic alone.
    """

    file: str
    frame: pl.DataFrame
    titles: list[str]
    groups: list[str]
    units: list[str]
    rows: NDArray[np.int64]
    line: str
    is_merged: bool = False

    def read(self, names: Sequence[str]) -> Table:
        """The columns with these titles, see `read_table`."""
        columns, units, starts, asked = {}, {}, {}, []
        for name in names:
            index = self.index(name)
            title = self.titles[index]
            check_unit(f"{self.file}, column {title}", title)
            columns[name], start = self.values(index, name)
            starts[name] = start or 0
            if unit := self.unit(index) if start is None else "s":
                units[name] = unit
            asked.append(index)
        rows = self.rows
        if self.is_merged:
            signals = [k for k in asked if self.titles[k] != bags.TIME] or asked
            is_own = np.any([self.frame.to_series(k).is_not_null() for k in signals], axis=0)
            columns = {name: values[is_own] for name, values in columns.items()}
            rows = rows[is_own]
        return Table(columns, units, starts, rows)

    def values(self, index: int, name: str) -> tuple[Floats, int | None]:
        """(n,) numbers of a column, and the date or time of day [ns] from which they count."""
        from tautscope.runs.cells import numbers  # noqa: PLC0415  with Polars, which takes 0.3 s

        return numbers(self.frame.to_series(index), self.file, self.line, name, self.rows)

    def unit(self, index: int) -> str:
        """Unit of a column, empty if the file does not name it."""
        below = self.units[index] if index < len(self.units) else ""
        return below or split_unit(self.titles[index])[1]

    def index(self, name: str) -> int:
        """The column of a title, of a title without its unit, of group/title, or of a number."""
        wanted = name.strip()
        grouped = [f"{group}/{title}" for group, title in zip(self.groups, self.titles)]  # noqa: B905
        names = [split_unit(each)[0] for each in self.titles]
        for candidates in (self.titles, names, grouped, [each.lower() for each in names]):
            matches = [k for k, each in enumerate(candidates) if each == wanted]
            if len(matches) == 1:
                return matches[0]
            if matches:
                numbers = " and ".join(str(k + 1) for k in matches)
                raise RecordError(
                    f"{self.file}: {name}",
                    f"{len(matches)} columns of this name",
                    f"one; type the number of the column, {numbers}",
                )
        if wanted.isdecimal() and 0 < int(wanted) <= len(self.titles):
            return int(wanted) - 1
        allowed = f"one of its columns: {', '.join(self.titles)}, or a number"
        raise RecordError(self.file, name, allowed)


def read_table(path: str | PathLike[str], names: Sequence[str], what: str = "record") -> Table:
    """Read columns of a CSV, Parquet, .npz or .mat file, or of a ROS 2 bag.

    A column is found by its title, or by its title without the unit in brackets or after the last
    underscore: ``tip``, ``tip [mm]``, ``tip (mm)``, ``tip_mm``; or by its number, from 1 on. Of a
    column with several numbers in each row they are ``tip.1``, ``tip.2``, ...
    Those of a bag are as in `tautscope.runs.bags.read_bag`. Of quaternions (``tip_qx`` to
    ``tip_qw``) and points (``tip_x`` to ``tip_z``) there are also ``tip_q_turn`` and
    ``tip_travel``, see `tautscope.runs.pose_columns`.

    Raises:
        MissingExtraError: Polars is not installed.
        MissingPathError: The file does not exist.
        RecordError: It is no table, a column is missing, or a cell is not a number; the error names
            file, line and column.
    """
    return open_table(path, what).read(names)


def open_table(path: str | PathLike[str], what: str = "record") -> Sheet:
    """Open a file or bag, see `read_table`."""
    return with_axes(_open(path, what))


def with_axes(sheet: Sheet) -> Sheet:
    """A table with the turns of its quaternions and the travels of its points as columns."""
    import polars as pl  # noqa: PLC0415

    added: list[pl.Series] = []
    for prefix, columns in find_axes(sheet.titles):
        try:
            values = np.stack([sheet.values(k, sheet.titles[k])[0] for k in columns], axis=1)
        except RecordError:
            continue
        is_turn = len(columns) == 4
        found = turn(values) if is_turn else travel(values)
        unit = "rad" if is_turn else sheet.unit(columns[0])
        title = title_of(prefix, "turn" if is_turn else "travel") + (f" [{unit}]" if unit else "")
        if found is not None and title not in (*sheet.titles, *(each.name for each in added)):
            added.append(pl.Series(title, found, nan_to_null=True))
    titles = [*sheet.titles, *(each.name for each in added)]
    return replace(sheet, frame=sheet.frame.hstack(added), titles=titles)


def _open(path: str | PathLike[str], what: str) -> Sheet:
    require_module("polars", "reading a table", "analysis")
    import polars as pl  # noqa: PLC0415  takes 0.3 s

    file = "standard input" if str(path) == STDIN else str(path)
    if Path(path).is_dir() or (Path(path).suffix in bags.SUFFIXES and Path(path).is_file()):
        frame = bags.read_bag(path)
        units = ["s", *("m" if _POINT.search(title) else "" for title in frame.columns[1:])]
        rows = np.arange(1, len(frame) + 1)
        return Sheet(file, frame, frame.columns, [], units, rows, "message", is_merged=True)
    data = _bytes(path, what)
    is_parquet = data.startswith(b"PAR1")
    arrays = read_arrays(data, file)
    text = None if is_parquet or arrays else split_table(data, file)
    try:
        if arrays:
            frame = pl.DataFrame(arrays)
        elif text is None:
            frame = with_single_numbers(pl.read_parquet(io.BytesIO(data)))
            if "episode_index" in frame.columns and frame["episode_index"].n_unique() > 1:
                count = f"{frame['episode_index'].n_unique()} episodes"
                raise RecordError(file, count, "one: give the data set's folder")
        else:
            head = text.delimiter.join(map(str, range(len(text.titles)))).encode()
            frame = pl.read_csv(
                head + b"\n" + text.data,
                separator=text.delimiter,
                infer_schema=False,
                truncate_ragged_lines=True,
            )
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        kind = "a Parquet file" if is_parquet else "a CSV file with a header line"
        raise RecordError(file, first_line(error), kind) from None
    if text is None:
        return Sheet(file, frame, frame.columns, [], [], np.arange(1, len(frame) + 1), "row")
    rows = text.rows
    if len(rows) != len(frame):  # cells of several lines
        rows = np.arange(len(frame)) + (rows[0] if len(rows) else 1)
    return Sheet(file, frame, text.titles, text.groups, text.units, rows, "line")


def filled(values: Floats) -> Floats:
    """Missing values interpolated between the nearest known ones before and after."""
    at, known = np.arange(len(values)), np.isfinite(values)
    return np.interp(at, at[known], values[known])


def _bytes(path: str | PathLike[str], what: str) -> bytes:
    if str(path) == STDIN:
        return sys.stdin.buffer.read()
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        allowed = "a CSV file with a header line, a Parquet, .npz or .mat file, or a ROS 2 bag"
        raise MissingPathError(what, str(path), allowed) from None
