"""References of the soak: strokes of given lengths, periodic or as an operator makes them."""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from plants.simulated import HALF
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.references import OperatorMotion, Reference, Segment

Floats = NDArray[np.float64]
Motion = Literal["sines", "hand", "rests"]
MOTIONS: tuple[Motion, ...] = ("sines", "hand", "rests")
PARTS = 10
"""Parts of a run of equal duration, each judged by itself."""
RATES = np.array([0.8, 0.63, 0.5])
"""Angular frequencies of the sines [rad/s]."""
RETURN = 5.0
"""Duration of the return to the first position at the end of each part [s]."""
MOVING, RESTING, EASING = 20.0, 36.0, 4.0
"""With rests: time of moving and of resting in turn, and of easing in and out of a rest [s]."""


@dataclass(frozen=True)
class SteadySines:
    """Sines on all DOFs at once, centre + amplitude sin(rate t); implements `Reference`.

    Attributes:
        centre: (3,) [m, rad, rad].
        amplitude: (3,) [m, rad, rad].
        duration: [s].
    """

    centre: Floats
    amplitude: Floats
    duration: float
    segments: ClassVar[tuple[Segment, ...]] = ()

    def __call__(self, time: float) -> Floats:
        """(3,) [m, rad, rad] at `time` [s from the start of the reference]."""
        return np.asarray(self.centre + self.amplitude * np.sin(RATES * time))


@dataclass(frozen=True)
class RepeatedMotion:
    """An operator's motion that repeats, so that all parts of a run have the same; a `Reference`.

    The last `RETURN` of each repetition are a minimum-jerk move to its first position.

    Attributes:
        motion: The motion; its duration is the period.
        duration: [s].
    """

    motion: OperatorMotion
    duration: float
    segments: ClassVar[tuple[Segment, ...]] = ()

    def __call__(self, time: float) -> Floats:
        """(3,) [m, rad, rad] at `time` [s from the start of the reference]."""
        phase, leaves = time % self.motion.duration, self.motion.duration - RETURN
        if phase <= leaves:
            return self.motion(phase)
        x, first, last = (phase - leaves) / RETURN, self.motion(0.0), self.motion(leaves)
        return last + (first - last) * x**3 * (10 - 15 * x + 6 * x**2)


@dataclass(frozen=True)
class RestingMotion:
    """A motion that is made for `MOVING` and stands for `RESTING`, again and again; a `Reference`.

    Its clock slows down evenly within `EASING` before a rest and speeds up after it.

    Attributes:
        motion: The motion; between two rests it goes on by `MOVING`.
        duration: [s].
    """

    motion: Reference
    duration: float
    segments: ClassVar[tuple[Segment, ...]] = ()

    def __call__(self, time: float) -> Floats:
        """(3,) [m, rad, rad] at `time` [s from the start of the reference]."""
        count, phase = divmod(time, MOVING + RESTING + EASING)
        # Easing takes twice the time of the part of the motion that it makes.
        begins, ends = EASING / 2, MOVING - EASING / 2
        if phase < EASING:
            own = phase**2 / (2 * EASING)
        else:
            own = begins + min(phase - EASING, ends - begins)
            eased = min(max(phase - EASING - (ends - begins), 0.0), EASING)
            own += eased - eased**2 / (2 * EASING)
        return self.motion(count * MOVING + own)


def make_reference(
    config: Config, motion: Motion, stroke: float, seed: int, seconds: float
) -> Reference:
    """Return a reference around the centres of the experiment.

    Args:
        config: `experiment` has the centres.
        motion: ``sines``; ``hand``, an operator's motion that repeats in every part; or
            ``rests``, the same with rests.
        stroke: Longest travel between two turning points, over the width of the slack in the
            article's Table 1: the amplitude is this many half widths.
        seed: Of the operator's motion.
        seconds: Duration [s].
    """
    amplitude = stroke * HALF
    if motion == "sines":
        centre = np.array([config.experiment[dof].centre for dof in Dof])
        return SteadySines(centre, amplitude, seconds)
    changes = {
        f"experiment.{dof.label}.amplitude": float(value)
        for dof, value in zip(Dof, amplitude, strict=True)
    }
    experiment = config.replace(**changes).experiment
    if motion == "hand":
        return RepeatedMotion(OperatorMotion(experiment, seed, seconds / PARTS), seconds)
    moving = seconds * MOVING / (MOVING + RESTING + EASING)
    repeated = RepeatedMotion(OperatorMotion(experiment, seed, moving / PARTS), moving)
    return RestingMotion(repeated, seconds)
