"""Whether motors are where they were told to be."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tautscope.config import DrivesConfig
from tautscope.dof import Dof

Floats = NDArray[np.float64]


class Following:
    """Compares where motors are with what was commanded of late.

    A motor that is never more than `DrivesConfig.lag` behind lies between the least and the largest
    command that was in force in that time,

        min c - e <= p <= max c + e,

    however fast it was told to go. It strays where the error e needed is above `following_error`,
    or above `following_window` for longer than `following_timeout`: half a millimetre for good
    teaches the loop a slack that is not there as surely as five for a moment. Right as long as
    every period has a command; what an encoder says wrong it cannot know.

    Args:
        config: Limits.
        period: From one command to the next [s].
        pending: Of the newest commands, how many no motor can have begun to follow when it is read.

    Attributes:
        least: Of the commands a motor may follow (3,) [m, rad, rad].
        largest: Likewise.
        error: How far outside of them the motors are (3,); 0 or less inside.
    """

    def __init__(self, config: DrivesConfig, period: float, pending: int = 0) -> None:
        self._limit = np.array([config[dof].following_error for dof in Dof])
        self._window = np.array([config[dof].following_window for dof in Dof])
        # What rounding adds to a quotient of whole milliseconds makes no further command.
        commands = 1 + math.ceil(config.lag / period - 1e-9) + pending
        self._timeout = round(config.following_timeout / period)
        self._recent = np.zeros((commands, 3))
        self._next = 0
        self._since = np.zeros(3, dtype=np.intp)
        self.begin(np.zeros(3))

    def begin(self, position: Floats) -> None:
        """At rest at a position (3,) [m, rad, rad]."""
        self._recent[:] = position
        self._since[:] = 0
        self.least = self.largest = position
        self.error: Floats = np.zeros(3)

    def strays(
        self, command: Floats, positions: Floats, fresh: Sequence[bool] = (True, True, True)
    ) -> NDArray[np.bool_]:
        """Which motors are not where they should be (3,), after a period.

        Args:
            command: What was sent in it (3,) [m, rad, rad].
            positions: Where the motors were read (3,) [m, rad, rad].
            fresh: Whether each was; one that was not is not judged, and its time stands.
        """
        self._recent[self._next] = command
        self._next = (self._next + 1) % len(self._recent)
        self.least, self.largest = self._recent.min(axis=0), self._recent.max(axis=0)
        self.error = np.maximum(self.least - positions, positions - self.largest)
        read = np.asarray(fresh)
        outside = self.error > self._window
        self._since += read & outside
        self._since[read & ~outside] = 0
        found: NDArray[np.bool_] = read & (
            (self.error > self._limit) | (self._since > self._timeout)
        )
        return found
