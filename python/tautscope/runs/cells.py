"""Cells of a table as numbers: decimal commas, dates and times of day; with Polars."""

from functools import partial

import numpy as np
import polars as pl
from numpy.typing import NDArray

from tautscope.errors import RecordError
from tautscope.runs.table_text import NO_VALUE

Floats = NDArray[np.float64]

LARGEST = 1e100
"""Largest number: the sum of the squares of larger ones may overflow. Its inverse is 0."""
_ALLOWED = f"a number up to {LARGEST:g}, or blank or NaN for none"
_DATES = ("%Y-%m-%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%Y/%m/%d")
_ZONE = r"[+-]\d\d:?\d\d"
_CLOCKS = ("%H:%M:%S%.f", "%I:%M:%S%.f %p")


def numbers(
    series: pl.Series, file: str, line: str, name: str, rows: NDArray[np.int64]
) -> tuple[Floats, int | None]:
    """A column as numbers; dates and times of day as seconds since the first one.

    The second value is that first one [ns], None of other columns.
    """
    if series.dtype.is_temporal():
        return _seconds(_nanoseconds(series))
    if series.dtype == pl.String:
        text = series.str.strip_chars().str.strip_chars('"').str.strip_chars()
        values = _with_decimal_point(text).cast(pl.Float64, strict=False)
        is_bad = values.is_null() & ~text.str.to_lowercase().is_in(NO_VALUE).fill_null(True)
        if is_bad.any() and not values.is_finite().any() and (times := _times(text)) is not None:
            return _seconds(times)
    elif series.dtype.is_numeric() or series.dtype == pl.Boolean:
        text, values = series, series.cast(pl.Float64)
        is_bad = pl.repeat(False, len(values), eager=True)
    else:
        raise RecordError(f"{file}, column {name}", str(series.dtype), "numbers")
    # Also infinities, but not NaN, which Polars orders above all numbers.
    is_bad |= ((values.abs() > LARGEST) & values.is_not_nan()).fill_null(False)
    if is_bad.any():
        index = int(is_bad.arg_max() or 0)
        where = f"{file}, {line} {rows[index]}, column {name}"
        raise RecordError(where, text[index], _ALLOWED)
    found = values.fill_null(float("nan")).to_numpy().astype(np.float64)
    return np.where(np.abs(found) < 1 / LARGEST, 0.0, found), None


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
    """Dates or times of day [ns], ISO 8601 or as people write them; None if a text is neither.

    Those without a time zone count as UTC.
    """
    plain = (
        text.str.replace(",", ".", literal=True)
        .str.replace(f"(Z|{_ZONE})$", "")
        .str.replace("T", " ", literal=True)
    )
    zone = text.str.extract(f"({_ZONE})$").str.replace(":", "", literal=True)
    hhmm = zone.cast(pl.Int64, strict=False).fill_null(0)
    minutes = hhmm.sign() * (hhmm.abs() // 100 * 60 + hhmm.abs() % 100)
    given = text.is_not_null() & (text != "")
    readers = [
        partial(plain.str.strptime, pl.Datetime("ns"), f"{date} {clock}", strict=False)
        for date in _DATES
        for clock in _CLOCKS
    ] + [partial(plain.str.strptime, pl.Time, clock, strict=False) for clock in _CLOCKS]
    for read in readers:
        if ((found := read()).is_not_null() == given).all():
            return _nanoseconds(found) - minutes * 60_000_000_000
    return None


def _nanoseconds(times: pl.Series) -> pl.Series:
    """Dates, times of day or durations as whole numbers [ns]."""
    if times.dtype == pl.Duration:
        return times.dt.total_nanoseconds()
    if times.dtype == pl.Time:
        return times.cast(pl.Int64)
    return times.cast(pl.Datetime("ns")).cast(pl.Int64)


def _seconds(ticks: pl.Series) -> tuple[Floats, int]:
    """Seconds since the first time, NaN where there is none; and the first time [ns]."""
    known = ticks.drop_nulls()
    first = int(known[0]) if len(known) else 0
    seconds = ((ticks - first).cast(pl.Float64) / 1e9).fill_null(float("nan"))
    return seconds.to_numpy().astype(np.float64), first
