"""Where the tip of the bench's instrument truly is, in a file; for evaluation alone."""

from __future__ import annotations

import threading
from collections import deque
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from tautscope.dof import Dof
from tautscope.errors import OutputError
from tautscope.hardware.realtime import OTHERS, step_back
from tautscope.runs.recording import per_dof

TRUTH = np.dtype([("time", "f8")] + [(f"true_{dof.label}", "f8") for dof in Dof])
"""A line of the truth: the tip (3,) [m, rad, rad] at an instant of the monotonic clock [s]."""
_WRITE_PERIOD = 0.1
"""How often lines are written [s]."""


class TruthFile:
    """Writes a CSV in a thread of its own: a disk that is busy must not hold the drives up.

    Args:
        path: It is replaced.

    Raises:
        OutputError: It cannot be written.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._file = path.open("w", encoding="utf-8")
        except OSError as error:
            place = f"a place that can be written ({error})"
            raise OutputError("--truth", str(path), place) from None
        self._lines: deque[tuple[float, float, float, float]] = deque()
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="truth", daemon=True)
        self._thread.start()

    def add(self, now: float, state: NDArray[np.float64]) -> None:
        """The tip (3,) [m, rad, rad] at an instant of the monotonic clock [s]."""
        self._lines.append((float(now), float(state[0]), float(state[1]), float(state[2])))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        step_back(OTHERS)
        with self._file as file:
            file.write(",".join(TRUTH.names or ()) + "\n")
            is_last = False
            while not is_last:
                is_last = self._ending.wait(_WRITE_PERIOD)
                while self._lines:
                    now, *state = self._lines.popleft()
                    file.write(f"{now!r}," + ",".join(f"{x:.9g}" for x in state) + "\n")
                file.flush()


def read_truth(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Instants (n,) [s, monotonic clock] and true tip states (n, 3) [m, rad, rad] of a bench."""
    table = np.loadtxt(path, TRUTH, delimiter=",", skiprows=1)
    return table["time"], per_dof(table, "true")
