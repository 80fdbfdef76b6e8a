"""Structured arrays as CSV files, without loss of precision."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tautscope.errors import MissingPathError, RecordError


def write_csv(path: Path, table: NDArray[np.void]) -> None:
    """Write a structured array as CSV with a header; every number is written in full."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(table.dtype.names or ())
        writer.writerows(table.tolist())


def read_csv(path: Path, dtype: np.dtype[np.void]) -> NDArray[np.void]:
    """Read a file of `write_csv`; equal to what was written, to the last bit.

    Raises:
        MissingPathError: The file does not exist.
        RecordError: A column or a cell is not as `write_csv` writes it.
    """
    if not path.is_file():
        raise MissingPathError("recording", str(path), "a file of a saved recording")
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = list(csv.reader(file)) or [[]]
    names = dtype.names or ()
    if tuple(header) != names:
        raise RecordError(str(path), ",".join(header), f"the columns {', '.join(names)}")
    table = np.empty(len(rows), dtype)
    try:
        columns = list(zip(*rows, strict=True)) or [()] * len(names)
        for name, column in zip(names, columns, strict=True):
            is_flag = dtype[name].kind == "b"
            table[name] = [cell == "True" for cell in column] if is_flag else column
    except ValueError as error:
        raise RecordError(str(path), str(error), "a number in every cell") from None
    return table
