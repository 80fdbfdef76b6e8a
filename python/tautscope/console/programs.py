"""How far an operator may move the reference, and motions that run by themselves."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.kinematics import Floats
from tautscope.loop.references import Motion, Move, SineSequence

LEAST_TIME = 0.1
"""Shortest duration of a move to the start [s]."""
MOVE_SPEED = 0.25
"""Peak speed of a move to the start [of the largest speed that the loop follows]."""
TRAVEL_MARGIN = 0.25
"""Distance of reference and command from the travel [in width_limit], but at most a quarter of the
travel."""
TWIN_TRAVEL = 4 / 3
"""Travel of the reference in the twin about the start position [in amplitudes]."""


class MotionLimits(NamedTuple):
    """Limits of the reference; every (n,) is [m or rad], or that per s.

    Attributes:
        speed: (n,) largest speed that the loop follows.
        least: (n,) least reference.
        most: (n,) largest reference.
        start: (n,) where the program "home" ends.
    """

    speed: Floats
    least: Floats
    most: Floats
    start: Floats


def motion_limits(config: Config) -> MotionLimits:
    """The limits in a configuration."""
    if config.dof:
        speed = np.array([dof.largest_speed for dof in config.dof])
        widths = np.array([dof.width_limit for dof in config.dof])
        travel = np.array([dof.travel for dof in config.dof])
        start = travel.mean(axis=1)
    else:
        speed, widths = np.array(config.safety.reference_speed), np.array(config.safety.width_limit)
        start = np.array([config.experiment[dof].centre for dof in Dof])
        if config.drives is None:
            reach = TWIN_TRAVEL * np.array([config.experiment[dof].amplitude for dof in Dof])
            return MotionLimits(speed, start - reach, start + reach, start)
        travel = np.array([config.drives[dof].travel for dof in Dof])
    margin = np.minimum(TRAVEL_MARGIN * widths, np.diff(travel)[:, 0] / 4)
    return MotionLimits(speed, travel[:, 0] + margin, travel[:, 1] - margin, start)


class Program:
    """Motions one after the other.

    Attributes:
        name: Its name for people.
        elapsed: Time since its start [s].
        duration: Total duration [s].
    """

    def __init__(self, name: str, motions: Sequence[Motion]) -> None:
        self.name, self._motions = name, motions
        self.elapsed, self.duration = 0.0, sum(motion.duration for motion in motions)

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


PROGRAMS = {"home": "homing", "sweep": "calibration sweep", "experiment": "experiment"}
"""Names for people by the names of the actions that start them."""


def program(name: str, config: Config, reference: Floats) -> Program:
    """A program of `PROGRAMS`.

    ``home`` is a slow move to the start position of the experiment, or the middle of the ranges.
    After it, ``sweep`` is one period of the experiment's sine per DOF, in which the slack is
    estimated, and ``experiment`` the article's.
    """
    limits = motion_limits(config)
    motions: list[Motion] = [Move(reference, limits.start, MOVE_SPEED * limits.speed, LEAST_TIME)]
    if name != "home":
        motions.append(SineSequence(config.experiment, 1 if name == "sweep" else None))
    return Program(PROGRAMS[name], motions)


def programs_of(config: Config) -> tuple[str, ...]:
    """Names of the programs of an instrument; the experiment is the article's."""
    return ("home",) if config.dof else tuple(PROGRAMS)
