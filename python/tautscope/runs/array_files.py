"""Arrays of NumPy and MATLAB files as columns, and columns with several numbers in a row."""

from __future__ import annotations

import io
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from tautscope.errors import RecordError
from tautscope.extras import require_module

if TYPE_CHECKING:
    import polars as pl

Arrays = dict[str, NDArray[Any]]

_MAT, _MAT_73, _ZIP = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file", b"PK\x03\x04"


def read_arrays(data: bytes, file: str) -> Arrays | None:
    """The columns of a .npz or .mat file, by name; None for another file.

    The samples are along the axis of the most frequent length; arrays of another length are left
    out. An array of several columns has the names NAME.1, NAME.2, ... A field of a MATLAB struct is
    NAME.FIELD.

    Raises:
        MissingExtraError: SciPy is not installed.
        RecordError: It has no arrays of numbers, or is a kind of file that is not read.
    """
    if data.startswith(_MAT_73):
        raise RecordError(file, "a .mat file of version 7.3", "version 7: save('-v7', ...)")
    if data.startswith(_MAT):
        found = _from_matlab(data, file)
    elif data.startswith(_ZIP):
        found = _from_numpy(data, file)
    else:
        return None
    arrays = {name: each for name, each in found.items() if each.ndim in (1, 2) and each.size > 1}
    if not arrays:
        raise RecordError(file, "no array of numbers", "arrays with a number for each sample")
    lengths = Counter(length for each in arrays.values() for length in set(each.shape) - {1})
    count = max(lengths, key=lambda length: (lengths[length], length))
    return dict(_columns(arrays, count))


def _columns(arrays: Arrays, count: int) -> Iterator[tuple[str, NDArray[Any]]]:
    for name, array in arrays.items():
        if array.shape[0] == count:
            table = array.reshape(count, -1)
        elif array.shape[-1] == count:
            table = array.T
        else:
            continue
        for number, column in enumerate(table.T, 1):
            title = name if table.shape[1] == 1 else f"{name}.{number}"
            yield title, np.ascontiguousarray(column)


def _from_numpy(data: bytes, file: str) -> Arrays:
    if b"[Content_Types].xml" in data:
        raise RecordError(file, "a spreadsheet", "a CSV file: save the sheet as CSV")
    try:
        with np.load(io.BytesIO(data)) as archive:
            return {name: archive[name] for name in archive if archive[name].dtype.kind in "fiub"}
    except Exception as error:
        raise RecordError(file, first_line(error), "a .npz file of numbers") from None


def _from_matlab(data: bytes, file: str) -> Arrays:
    """In a process of its own, of this file: SciPy's reader may crash it on a damaged file."""
    require_module("scipy", "reading a .mat file", "analysis")
    command = [sys.executable, "-m", __name__]
    done = subprocess.run(command, input=data, capture_output=True, check=False)
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").splitlines()
        reason = said[-1] if done.returncode == 1 and said else "a damaged file"
        raise RecordError(file, reason, "a .mat file of numbers")
    return _from_numpy(done.stdout, file)


def first_line(error: BaseException) -> str:
    """The first line of an error of a library; its type if it has none."""
    return next(iter(str(error).splitlines()), "") or type(error).__name__


def with_single_numbers(
    frame: pl.DataFrame, names: Mapping[str, Sequence[str]] | None = None
) -> pl.DataFrame:
    """A table in which each column with lists of numbers has become columns NAME.1, NAME.2, ...

    Its `names` stand in place of 1, 2, ... if they are as many and differ.
    """
    import polars as pl  # noqa: PLC0415

    columns: list[pl.Series] = []
    for column in frame:
        if not isinstance(column.dtype, pl.List | pl.Array):
            columns.append(column)
            continue
        lists = column.cast(pl.List(column.dtype.inner))
        width = int(lists.list.len().max() or 0)  # type: ignore[arg-type]
        given = (names or {}).get(column.name, ())
        ends = given if len(set(given)) == len(given) == width else range(1, width + 1)
        columns += [
            lists.list.get(k, null_on_oob=True).alias(f"{column.name}.{end}")
            for k, end in enumerate(ends)
        ]
    return pl.DataFrame(columns)


def _from_mat_to_npz() -> None:
    """A .mat file on standard input becomes a .npz file on standard output."""
    from scipy.io import loadmat  # noqa: PLC0415  an extra

    try:
        found = loadmat(io.BytesIO(sys.stdin.buffer.read()), simplify_cells=True)
        arrays = dict(_numeric("", found))
    except Exception as error:  # of any kind, for a damaged file
        raise SystemExit(f"{type(error).__name__}: {error}") from None
    np.savez(sys.stdout.buffer, **arrays)  # type: ignore[arg-type]


def _numeric(prefix: str, found: dict[str, Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    """The arrays of numbers, those of structs as NAME.FIELD."""
    for name, value in found.items():
        if isinstance(value, dict):
            yield from _numeric(f"{prefix}{name}.", value)
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiub":
            yield prefix + name, value


if __name__ == "__main__":
    _from_mat_to_npz()
