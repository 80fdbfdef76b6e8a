"""A file of the true tip state of the bench's instrument, for evaluation only."""

from collections import deque
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from tautscope.bench.events import repeating
from tautscope.dof import Dof
from tautscope.errors import OutputError
from tautscope.runs.recording import per_dof

TRUTH = np.dtype([("time", "f8")] + [(f"true_{dof.label}", "f8") for dof in Dof])
"""Columns: time of the monotonic clock [s] and true tip state (3,) [m, rad, rad]."""
_WRITE_PERIOD = 0.1
"""Time from one write to the next [s]."""


class GroundTruthWriter:
    """Writes or overwrites a CSV in a thread, so that a busy disk cannot delay the drives.

    Raises:
        OutputError: The file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._resources = path, ExitStack()
        try:
            self._file = path.open("w", encoding="utf-8")
        except OSError as error:
            raise self._refused(error) from None
        self._lines = deque([",".join(TRUTH.names or ())])

    def add(self, now: float, state: NDArray[np.float64]) -> None:
        """Add the tip state (3,) [m, rad, rad] at a time of the monotonic clock [s]."""
        self._lines.append(f"{float(now)!r}," + ",".join(f"{x:.9g}" for x in state))

    def __enter__(self) -> Self:
        self._resources.enter_context(self._file)
        self._resources.enter_context(repeating(self._write, _WRITE_PERIOD))
        return self

    def __exit__(self, *failure: object) -> None:
        self._resources.close()

    def _write(self) -> None:
        try:
            while self._lines:
                self._file.write(self._lines.popleft() + "\n")
            self._file.flush()
        except OSError as error:
            raise self._refused(error) from None

    def _refused(self, error: OSError) -> OutputError:
        return OutputError("--truth", str(self._path), f"a file that can be written ({error})")


def read_ground_truth(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Read times (n,) [s, monotonic clock] and true tip states (n, 3) [m, rad, rad]."""
    table = np.loadtxt(path, TRUTH, delimiter=",", skiprows=1)
    return table["time"], per_dof(table, "true")
