"""Columns of recorded tables: CSV of any dialect, Parquet, standard input; read with Polars.

What the text does not say is recognised: encoding, delimiter, decimal comma, comment lines, and a
line of units below the header.
"""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tautscope.errors import MissingExtraError, MissingPathError, RecordError
from tautscope.runs.units import split_unit, unit_of

if TYPE_CHECKING:
    import polars as pl

Floats = NDArray[np.float64]

STDIN = "-"
_LEFT_OUT = re.compile(rb"^[ \t]*(?:$|#|%|//)", re.MULTILINE)
_HEAD = 50  # lines by which the dialect is recognised
_DELIMITERS = ("\t", ";", ",", "|")
_NO_VALUE = ("", "nan", "na", "n/a", "null", "none", "-")
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")
_ALLOWED = "a finite number, or blank or NaN for none"


@dataclass(frozen=True, eq=False)
class Table:
    """Numeric columns of a table.

    Attributes:
        columns: Name as asked for -> (n,) values; NaN where there is none. Times of day and dates
            are seconds since the first one.
        units: Name as asked for -> unit of the header or the line of units, if there is one.
        rows: (n,) line of the file, from 1 on; of Parquet the row, from 1 on.
    """

    columns: dict[str, Floats]
    units: dict[str, str]
    rows: NDArray[np.int64]


def read_table(path: str | PathLike[str], names: Sequence[str], what: str = "record") -> Table:
    """Read columns of a CSV or Parquet file.

    A column is found by its title, or by its title without the unit in brackets or after the last
    underscore: ``tip``, ``tip [mm]``, ``tip (mm)``, ``tip_mm``.

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
    if find_spec("polars") is None:
        raise MissingExtraError("reading a table", ("polars",), ("analysis",))
    name = "standard input" if str(path) == STDIN else str(path)
    data = _bytes(path, what)
    if data.startswith(b"PAR1"):
        return _read_parquet(data, name, names)
    return _Text(data, name).read(names)


def _bytes(path: str | PathLike[str], what: str) -> bytes:
    if str(path) == STDIN:
        return sys.stdin.buffer.read()
    try:
        return Path(path).read_bytes()
    except (FileNotFoundError, IsADirectoryError):
        allowed = "a CSV file with a header line, or a Parquet file"
        raise MissingPathError(what, str(path), allowed) from None


def _read_parquet(data: bytes, file: str, names: Sequence[str]) -> Table:
    import polars as pl  # noqa: PLC0415  takes 0.3 s

    try:
        frame = pl.read_parquet(io.BytesIO(data))
    except pl.exceptions.PolarsError as error:
        raise RecordError(file, str(error), "a Parquet file") from None
    titles = [_column(file, frame.columns, name) for name in names]
    rows = np.arange(1, len(frame) + 1)
    columns = {
        name: _numbers(frame[title], file, "row", name, rows)
        for name, title in zip(names, titles, strict=True)
    }
    units = {
        name: unit
        for name, title in zip(names, titles, strict=True)
        if (unit := split_unit(title)[1])
    }
    return Table(columns, units, rows)


class _Text:
    """A table as text.

    Args:
        data: Content of the file.
        file: Its name, for errors.
    """

    def __init__(self, data: bytes, file: str) -> None:
        self._file = file
        data = self._as_utf8(data).rstrip()
        self._lines: NDArray[np.int64] | None = None  # of the rows, if some were left out
        if _LEFT_OUT.search(data):
            lines = data.split(b"\n")
            kept = [k for k, line in enumerate(lines) if not _LEFT_OUT.match(line)]
            self._lines = np.array(kept, dtype=np.int64) + 1
            data = b"\n".join([lines[k] for k in kept])
        if not data:
            raise RecordError(file, "there is no header", "a header line with the columns' titles")
        self._delimiter = _delimiter(data.split(b"\n", _HEAD)[:_HEAD])
        if self._delimiter == " ":
            data = re.sub(rb"[ \t]+", b"\t", re.sub(rb"(?m)^[ \t]+", b"", data))
            self._delimiter = "\t"
        head = [self._cells(line) for line in data.split(b"\n", _HEAD)[:_HEAD]]
        self.header = head[0]
        self._units: list[str] = []
        if len(head) > 1 and any(head[1]) and all(not cell or unit_of(cell) for cell in head[1]):
            self._units = [unit_of(cell) for cell in head[1]]
        self._above = 2 if self._units else 1
        cells = [cell for line in head[self._above :] for cell in line]
        has_comma = any(_DECIMAL_COMMA.fullmatch(cell) for cell in cells)
        self._has_decimal_comma = self._delimiter != "," and has_comma
        self._data = data

    def read(self, names: Sequence[str]) -> Table:
        """The columns with these titles."""
        import polars as pl  # noqa: PLC0415  takes 0.3 s

        at = [self.header.index(_column(self._file, self.header, name)) for name in names]
        try:
            frame = pl.read_csv(
                self._data,
                separator=self._delimiter,
                skip_rows_after_header=self._above - 1,
                columns=sorted(set(at)),
                infer_schema=False,
                truncate_ragged_lines=True,
            )
        except pl.exceptions.PolarsError as error:
            reason = str(error).splitlines()[0]
            raise RecordError(self._file, reason, "a CSV file with a header line") from None
        rows = np.arange(len(frame)) + 1 + self._above
        if self._lines is not None and len(self._lines) == len(frame) + self._above:
            rows = self._lines[self._above :]
        columns, units = {}, {}
        for name, index in zip(names, at, strict=True):
            series = frame.to_series(sorted(set(at)).index(index))
            if self._has_decimal_comma:
                series = series.str.replace(",", ".", literal=True)
            columns[name] = _numbers(series, self._file, "line", name, rows)
            below = self._units[index] if index < len(self._units) else ""
            if unit := below or split_unit(self.header[index])[1]:
                units[name] = unit
        return Table(columns, units, rows)

    def _as_utf8(self, data: bytes) -> bytes:
        for mark, encoding in ((b"\xff\xfe", "utf-16"), (b"\xfe\xff", "utf-16")):
            if data.startswith(mark):
                try:
                    data = data.decode(encoding).encode()
                except UnicodeDecodeError as error:
                    raise self._not_text(str(error)) from None
        data = data.removeprefix(b"\xef\xbb\xbf")
        if b"\0" in data:
            raise self._not_text("a zero byte")
        try:
            data.decode()
        except UnicodeDecodeError:
            data = data.decode("latin-1").encode()
        return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n")

    def _not_text(self, reason: str) -> RecordError:
        return RecordError(self._file, reason, "a CSV file with a header line, or a Parquet file")

    def _cells(self, line: bytes) -> list[str]:
        cells = line.decode().split(self._delimiter)
        return [cell.strip().strip('"').strip() for cell in cells]


def _delimiter(head: Sequence[bytes]) -> str:
    """The delimiter that splits the header and the lines below it into as many cells."""
    lines = [line.decode() for line in head]
    for delimiter in _DELIMITERS:
        counts = [line.count(delimiter) for line in lines]
        if counts[0] and np.median(counts) == counts[0]:
            return delimiter
    most = max(_DELIMITERS, key=lines[0].count)
    if most not in lines[0] and len({len(line.split()) for line in lines}) == 1:
        return " " if len(lines[0].split()) > 1 else ","
    return most if most in lines[0] else ","


def _column(file: str, header: Sequence[str], name: str) -> str:
    """The title of a column."""
    wanted = name.strip()
    for matches in (
        [title for title in header if title == wanted],
        [title for title in header if split_unit(title)[0] == wanted],
    ):
        if len(matches) == 1:
            return matches[0]
        if matches:
            raise RecordError(f"{file}: {name}", f"{len(matches)} columns of this name", "one")
    raise RecordError(file, name, f"one of its columns: {', '.join(header)}")


def _numbers(series: pl.Series, file: str, line: str, name: str, rows: NDArray[np.int64]) -> Floats:
    """A column as numbers; times become seconds since the first one."""
    import polars as pl  # noqa: PLC0415

    if series.dtype == pl.String:
        text = series.str.strip_chars().str.strip_chars('"')
        values = text.cast(pl.Float64, strict=False)
        is_bad = values.is_null() & ~text.str.to_lowercase().is_in(_NO_VALUE).fill_null(True)
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


def _times(text: pl.Series) -> pl.Series | None:
    """Texts as dates or times of day of ISO 8601; None if one is neither."""
    import polars as pl  # noqa: PLC0415

    plain = text.str.replace(r"(Z|[+-]\d\d:?\d\d)$", "").str.replace(" ", "T", literal=True)
    given = text.is_not_null() & (text != "")
    for times in (
        plain.str.strptime(pl.Datetime("ns"), "%Y-%m-%dT%H:%M:%S%.f", strict=False),
        text.str.strptime(pl.Time, "%H:%M:%S%.f", strict=False),
    ):
        if (times.is_not_null() == given).all():
            return times
    return None


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
