"""Supervision of the following error, in software."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tautscope.config import DrivesConfig

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
        lower: Smallest recent command (n,) [m or rad].
        upper: Largest recent command (n,) [m or rad].
        error: Following error (n,) [m or rad]; 0 or less inside the range.
    """

    def __init__(self, config: DrivesConfig, period: float, pending: int = 0) -> None:
        self._limit = np.array([config[dof].following_error for dof in config.all_motors])
        self._window = np.array([config[dof].following_window for dof in config.all_motors])
        # 1e-9: rounding of the quotient must not add a command.
        commands = 1 + math.ceil(config.lag / period - 1e-9) + pending
        self._timeout = round(config.following_timeout / period)
        self._recent = np.zeros((commands, len(self._limit)))
        self._next = 0
        self._outside_count = np.zeros(len(self._limit), dtype=np.intp)
        self.reset(np.zeros(len(self._limit)))

    def reset(self, position: Floats) -> None:
        """Start at rest at a position (n,) [m or rad]."""
        self._recent[:] = position
        self._outside_count[:] = 0
        self.lower = self.upper = position
        self.error: Floats = np.zeros(len(self._limit))

    def update(
        self, command: Floats, positions: Floats, fresh: Sequence[bool] | bool = True
    ) -> NDArray[np.bool_]:
        """Take one period; true (n,) for each motor whose following error is too large.

        Args:
            command: The command sent in this period (n,) [m or rad].
            positions: Position actual values (n,) [m or rad].
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
