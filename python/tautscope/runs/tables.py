"""Columns of recorded tables: CSV of any dialect, Parquet, arrays, standard input; with Polars."""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tautscope.errors import MissingExtraError, MissingPathError, RecordError
from tautscope.runs.array_files import read_arrays, with_single_numbers
from tautscope.runs.table_text import NO_VALUE, split_table
from tautscope.runs.units import check_unit, split_unit

if TYPE_CHECKING:
    import polars as pl

Floats = NDArray[np.float64]

STDIN = "-"
_ALLOWED = "a finite number, or blank or NaN for none"
_DATES = ("%Y-%m-%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%Y/%m/%d")
_CLOCKS = ("%H:%M:%S%.f", "%I:%M:%S%.f %p")


@dataclass(frozen=True, eq=False)
class Table:
    """Numeric columns of a table.

    Attributes:
        columns: Name as asked for -> (n,) values; NaN where there is none. Times of day and dates
            are seconds since the first one.
        units: Name as asked for -> unit of the header or the line of units, if there is one.
        rows: (n,) line of a CSV file, from 1 on; of other files the row, from 1 on.
    """

    columns: dict[str, Floats]
    units: dict[str, str]
    rows: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Sheet:
    """A table whose cells are not read yet.

    Attributes:
        file: Its name, for errors.
        frame: Columns of text, or of Parquet and arrays as they are, in the order of the file.
        titles: Of the columns; their numbers if there is no title row.
        groups: Titles above the titles, or none.
        units: Of a line of units, or none.
        rows: See `Table`.
        line: What a row is called: "line" or "row".
    """

    file: str
    frame: pl.DataFrame
    titles: list[str]
    groups: list[str]
    units: list[str]
    rows: NDArray[np.int64]
    line: str

    def read(self, names: Sequence[str]) -> Table:
        """The columns with these titles, see `read_table`."""
        columns, units = {}, {}
        for name in names:
            index = self.index(name)
            title = self.titles[index]
            check_unit(f"{self.file}, column {title}", title)
            columns[name] = self.values(index, name)
            if unit := self.unit(index):
                units[name] = unit
        return Table(columns, units, self.rows)

    def values(self, index: int, name: str) -> Floats:
        """(n,) numbers of a column."""
        return _numbers(self.frame.to_series(index), self.file, self.line, name, self.rows)

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
    """Read columns of a CSV, Parquet, .npz or .mat file.

    A column is found by its title, or by its title without the unit in brackets or after the last
    underscore: ``tip``, ``tip [mm]``, ``tip (mm)``, ``tip_mm``; or by its number, from 1 on. Of a
    column with several numbers in each row they are ``tip.1``, ``tip.2``, ...

    Args:
        path: The file; ``-`` is standard input.
        names: Titles of the columns.
        what: What the file is, for errors.

    Raises:
        MissingExtraError: Polars is not installed.
        MissingPathError: The file does not exist.
        RecordError: It is no table, a column is missing, or a cell is not a number; the error names
            file, line and column.
    """
    return open_table(path, what).read(names)


def open_table(path: str | PathLike[str], what: str = "record") -> Sheet:
    """Open a file, see `read_table`."""
    if find_spec("polars") is None:
        raise MissingExtraError("reading a table", ("polars",), ("analysis",))
    import polars as pl  # noqa: PLC0415  takes 0.3 s

    file = "standard input" if str(path) == STDIN else str(path)
    data = _bytes(path, what)
    is_parquet = data.startswith(b"PAR1")
    arrays = read_arrays(data, file)
    text = None if is_parquet or arrays else split_table(data, file)
    try:
        if arrays:
            frame = pl.DataFrame(arrays)
        elif text is None:
            frame = with_single_numbers(pl.read_parquet(io.BytesIO(data)))
        else:
            numbers = text.delimiter.join(map(str, range(text.width))).encode()
            frame = pl.read_csv(
                numbers + b"\n" + text.data,
                separator=text.delimiter,
                infer_schema=False,
                truncate_ragged_lines=True,
            )
    except pl.exceptions.PolarsError as error:
        kind = "a Parquet file" if is_parquet else "a CSV file with a header line"
        raise RecordError(file, str(error).splitlines()[0], kind) from None
    if text is None:
        return Sheet(file, frame, frame.columns, [], [], np.arange(1, len(frame) + 1), "row")
    titles = text.titles + [str(k + 1) for k in range(len(text.titles), text.width)]
    rows = text.rows
    if len(rows) != len(frame):  # cells of several lines
        rows = np.arange(len(frame)) + (rows[0] if len(rows) else 1)
    return Sheet(file, frame, titles, text.groups, text.units, rows, "line")


def filled(values: Floats) -> Floats:
    """Missing values interpolated between the nearest known ones before and after."""
    at, known = np.arange(len(values)), np.isfinite(values)
    return np.interp(at, at[known], values[known])


def _bytes(path: str | PathLike[str], what: str) -> bytes:
    if str(path) == STDIN:
        return sys.stdin.buffer.read()
    try:
        return Path(path).read_bytes()
    except (FileNotFoundError, IsADirectoryError):
        allowed = "a CSV file with a header line, or a Parquet, .npz or .mat file"
        raise MissingPathError(what, str(path), allowed) from None


def _numbers(series: pl.Series, file: str, line: str, name: str, rows: NDArray[np.int64]) -> Floats:
    """A column as numbers; times become seconds since the first one."""
    import polars as pl  # noqa: PLC0415

    if series.dtype == pl.String:
        text = series.str.strip_chars().str.strip_chars('"').str.strip_chars()
        values = _with_decimal_point(text).cast(pl.Float64, strict=False)
        is_bad = values.is_null() & ~text.str.to_lowercase().is_in(NO_VALUE).fill_null(True)
        if is_bad.any() and not values.is_finite().any() and (times := _times(text)) is not None:
            return _seconds(times)
        is_bad = is_bad | values.is_infinite().fill_null(False)
        if is_bad.any():
            index = int(is_bad.arg_max() or 0)
            where = f"{file}, {line} {rows[index]}, column {name}"
            raise RecordError(where, text[index], _ALLOWED)
        return values.fill_null(float("nan")).to_numpy().astype(np.float64)
    if series.dtype.is_temporal():
        return _seconds(series)
    if not (series.dtype.is_numeric() or series.dtype == pl.Boolean):
        raise RecordError(f"{file}, column {name}", str(series.dtype), "numbers")
    values = series.cast(pl.Float64)
    if values.is_infinite().any():
        index = int(values.is_infinite().arg_max() or 0)
        where = f"{file}, {line} {rows[index]}, column {name}"
        raise RecordError(where, values[index], _ALLOWED)
    return values.fill_null(float("nan")).to_numpy().astype(np.float64)


def _with_decimal_point(text: pl.Series) -> pl.Series:
    """Numbers with a decimal comma, also 1.234,5; unchanged if others have a point alone."""
    has_comma = text.str.contains(",", literal=True).fill_null(False)
    has_point = text.str.contains(".", literal=True).fill_null(False)
    if not has_comma.any() or (has_point & ~has_comma).any():
        return text
    if text.str.contains(r",.*[.,]").fill_null(False).any():
        return text
    return text.str.replace_all(".", "", literal=True).str.replace(",", ".", literal=True)


def _times(text: pl.Series) -> pl.Series | None:
    """Texts as dates or times of day, ISO 8601 or as people write them; None if one is neither."""
    import polars as pl  # noqa: PLC0415

    plain = (
        text.str.replace(",", ".", literal=True)
        .str.replace(r"(Z|[+-]\d\d:?\d\d)$", "")
        .str.replace("T", " ", literal=True)
    )
    given = text.is_not_null() & (text != "")
    readers = [
        partial(plain.str.strptime, pl.Datetime("ns"), f"{date} {clock}", strict=False)
        for date in _DATES
        for clock in _CLOCKS
    ] + [partial(plain.str.strptime, pl.Time, clock, strict=False) for clock in _CLOCKS]
    return next(
        (found for read in readers if ((found := read()).is_not_null() == given).all()), None
    )


def _seconds(times: pl.Series) -> Floats:
    """Seconds since the first time; NaN where there is none."""
    import polars as pl  # noqa: PLC0415

    if times.dtype == pl.Duration:
        ticks = times.dt.total_nanoseconds()
    elif times.dtype == pl.Time:
        ticks = times.cast(pl.Int64)
    else:
        ticks = times.cast(pl.Datetime("ns")).cast(pl.Int64)
    first = ticks.drop_nulls()
    relative = ticks - (first[0] if len(first) else 0)
    return (relative.cast(pl.Float64) / 1e9).fill_null(float("nan")).to_numpy().astype(np.float64)
