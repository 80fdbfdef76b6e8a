"""The motion of a robot's calibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.errors import ConfigError
from tautscope.loop.references import Segment

DURATION = 60.0
"""Duration [s]."""
SHARE = 0.4
"""Amplitude about the middle of a range [share of the range]."""
_PERIOD, _RATIO = 9.0, 0.875
_SPEED_SHARE = 0.5
_GROWTH_TIME = 2.0


@dataclass(frozen=True)
class Sweep:
    """Sines of all degrees of freedom at once, with periods that do not repeat.

        u = middle + 0.4 (high - low) min(t / 2 s, 1) sin(2 pi t / T)

    of each range, with T = 9 s times 0.875 to the power of its place, or longer where the speed
    would exceed half of `dof.speed`.

    Raises:
        ConfigError: A degree of freedom has no range.
    """

    config: Config
    duration: float = DURATION
    segments: ClassVar[Sequence[Segment]] = ()

    def __post_init__(self) -> None:
        for index, dof in enumerate(self.config.dof):
            if dof.range is None:
                allowed = "a range, within which the motors move"
                raise ConfigError(f"dof[{index}].range", None, allowed)

    def __call__(self, time: float) -> NDArray[np.float64]:
        """Command (n,) [m or rad] at a time [s from the start]."""
        growth, command = min(time / _GROWTH_TIME, 1.0), []
        for index, dof in enumerate(self.config.dof):
            low, high = dof.range or (0.0, 0.0)
            amplitude = SHARE * (high - low)
            speed = _SPEED_SHARE * (dof.speed or 2 * dof.width_limit)
            period = max(_PERIOD * _RATIO**index, 2 * np.pi * amplitude / speed)
            sine = np.sin(2 * np.pi * time / period)
            command.append((low + high) / 2 + growth * amplitude * sine)
        return np.array(command)
