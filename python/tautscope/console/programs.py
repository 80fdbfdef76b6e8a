"""Motions that run by themselves while the operator's page is present."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.console.motion_limits import motion_limits
from tautscope.loop.references import MINIMUM_JERK_PEAK, Motion, SineSequence

Floats = NDArray[np.float64]
MOVE_SPEED = 0.25
"""Peak speed of a move to the start [of the largest speed that the loop follows]."""


class Move:
    """A minimum-jerk move of all DOFs between two positions (n,) [m or rad].

    u = a + (b - a) (10 x^3 - 15 x^4 + 6 x^5), x = time / duration, as fast as `speed` (n,) allows.
    """

    def __init__(self, start: Floats, end: Floats, speed: Floats) -> None:
        self._start, self._travel = start.copy(), end - start
        self.duration = float(max(MINIMUM_JERK_PEAK * np.max(np.abs(self._travel) / speed), 0.1))

    def __call__(self, time: float) -> Floats:
        """(n,) [m or rad] at `time` [s from its start]."""
        x = min(max(time / self.duration, 0.0), 1.0)
        return self._start + self._travel * x**3 * (10 - 15 * x + 6 * x**2)


class Program:
    """Motions one after the other.

    Attributes:
        name: Its name for people.
        elapsed: Time since its start [s].
        duration: Total duration [s].
    """

    def __init__(self, name: str, motions: Sequence[Motion]) -> None:
        self.name = name
        self._motions = motions
        self.elapsed = 0.0
        self.duration = sum(motion.duration for motion in motions)

    @property
    def is_over(self) -> bool:
        """Whether the last motion has ended."""
        return self.elapsed >= self.duration

    def advance(self, period: float) -> Floats:
        """The reference (n,) [m or rad] after a further period [s]."""
        self.elapsed += period
        time = self.elapsed
        for motion in self._motions[:-1]:
            if time < motion.duration:
                return motion(time)
            time -= motion.duration
        return self._motions[-1](time)


def home(config: Config, reference: Floats) -> Program:
    """A slow move to the start position of the experiment, or the middle of the ranges."""
    return Program("homing", [_move_to_start(config, reference)])


def experiment(config: Config, reference: Floats) -> Program:
    """The article's experiment after a move to its start."""
    sines = SineSequence(config.experiment)
    return Program("experiment", [_move_to_start(config, reference), sines])


def sweep(config: Config, reference: Floats) -> Program:
    """One period of the experiment's sine per DOF, in which the slack is estimated."""
    sines = SineSequence(config.experiment, periods=1)
    return Program("calibration sweep", [_move_to_start(config, reference), sines])


def _move_to_start(config: Config, reference: Floats) -> Move:
    limits = motion_limits(config)
    return Move(reference, limits.start, MOVE_SPEED * limits.speed)


PROGRAMS: dict[str, Callable[[Config, Floats], Program]] = {
    "home": home,
    "sweep": sweep,
    "experiment": experiment,
}
"""By the names of the actions that start them."""


def programs_of(config: Config) -> tuple[str, ...]:
    """Names of the programs of an instrument; the experiment is the article's."""
    return ("home",) if config.dof else tuple(PROGRAMS)
