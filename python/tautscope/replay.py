"""The estimator on a record: any motor position beside any tip position, no camera needed."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.errors import MissingPathError, RecordError, SignalError

if TYPE_CHECKING:
    from tautscope import Estimator

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Record:
    """Columns of a recorded file.

    Attributes:
        command: (n,) actuator position, the user's unit.
        measured: (n,) tip position, the same unit.
        time: (n,) [s] if it was asked for; the estimator does not read it.
        rows: (n,) line of the file each sample is from.
        dropped: Lines left out because one of the columns was blank or NaN there.
    """

    command: Floats
    measured: Floats
    time: Floats | None
    rows: NDArray[np.int64]
    dropped: int


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
    """Read columns of a CSV file with a header line.

    A line in which one of the columns is blank or NaN is left out and counted: loggers write such
    lines where a sensor had no news. Any other text is an error.

    Raises:
        MissingPathError: There is no such file.
        RecordError: A column is not there, a cell is not a number, or fewer than two samples are
            left; the error names file, line and column.
    """
    file = Path(path)
    names = [command, measured] + ([] if time is None else [time])
    samples: list[list[float]] = []
    rows: list[int] = []
    dropped = 0
    try:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.reader(stream)
            header = [name.strip() for name in next(reader, [])]
            places = [_column(file, header, name) for name in names]
            for line in reader:
                if not line:
                    continue
                values = _numbers(file, reader.line_num, line, places, names)
                if any(math.isnan(value) for value in values):
                    dropped += 1
                    continue
                samples.append(values)
                rows.append(reader.line_num)
    except (FileNotFoundError, IsADirectoryError):
        raise MissingPathError("record", str(file), "a CSV file with a header line") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordError(str(file), str(error), "a CSV file with a header line") from None
    if len(samples) < 2:
        raise RecordError(str(file), f"{len(samples)} samples", "at least 2")
    columns = np.array(samples).T
    return Record(
        columns[0], columns[1], None if time is None else columns[2], np.array(rows), dropped
    )


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
        raise RecordError(f"{file}: {name}", what, f"one of {', '.join(header) or 'no header'}")
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
