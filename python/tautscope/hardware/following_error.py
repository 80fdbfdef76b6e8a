"""Supervision of the following error, in software."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tautscope.config import DrivesConfig
from tautscope.dof import Dof

Floats = NDArray[np.float64]


class FollowingErrorMonitor:
    """Compares position actual values with the commands of the last `DrivesConfig.lag` seconds.

    A motor that lags by no more than that lies between the smallest and the largest of these
    commands, at any speed. With position p and commands c, the following error is the smallest e
    with

        min c - e <= p <= max c + e.

    It is too large above `following_error`, or above `following_window` for longer than
    `following_timeout`: the loop would estimate a small constant error as backlash.

    Wrong when a period has no command, or the encoder is wrong: it then agrees with every command.

    Args:
        config: Limits.
        period: Time from one command to the next [s].
        pending: Number of newest commands that cannot have an effect yet when positions are read.

    Attributes:
        lower: Smallest recent command (3,) [m, rad, rad].
        upper: Largest recent command (3,) [m, rad, rad].
        error: Following error (3,) [m, rad, rad]; 0 or less inside the range.
    """

    def __init__(self, config: DrivesConfig, period: float, pending: int = 0) -> None:
        self._limit = np.array([config[dof].following_error for dof in Dof])
        self._window = np.array([config[dof].following_window for dof in Dof])
        # 1e-9: rounding of the quotient must not add a command.
        commands = 1 + math.ceil(config.lag / period - 1e-9) + pending
        self._timeout = round(config.following_timeout / period)
        self._recent = np.zeros((commands, 3))
        self._next = 0
        self._outside_count = np.zeros(3, dtype=np.intp)
        self.reset(np.zeros(3))

    def reset(self, position: Floats) -> None:
        """Start at rest at a position (3,) [m, rad, rad]."""
        self._recent[:] = position
        self._outside_count[:] = 0
        self.lower = self.upper = position
        self.error: Floats = np.zeros(3)

    def update(
        self, command: Floats, positions: Floats, fresh: Sequence[bool] = (True, True, True)
    ) -> NDArray[np.bool_]:
        """Take one period; true (3,) for each motor whose following error is too large.

        Args:
            command: The command sent in this period (3,) [m, rad, rad].
            positions: Position actual values (3,) [m, rad, rad].
            fresh: Whether each position is new; an old one is not checked, and its timer is held.
        """
        self._recent[self._next] = command
        self._next = (self._next + 1) % len(self._recent)
        self.lower, self.upper = self._recent.min(axis=0), self._recent.max(axis=0)
        self.error = np.maximum(self.lower - positions, positions - self.upper)
        read = np.asarray(fresh)
        outside = self.error > self._window
        self._outside_count += read & outside
        self._outside_count[read & ~outside] = 0
        exceeded: NDArray[np.bool_] = read & (
            (self.error > self._limit) | (self._outside_count > self._timeout)
        )
        return exceeded
