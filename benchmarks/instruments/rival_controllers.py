"""What a laboratory would use instead: visual servoing, and constant compensation."""

from collections import deque
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from tautscope._core import Compensator
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.reduction import HysteresisReduction, Status
from tautscope.loop.safety import Reaction

Floats = NDArray[np.float64]
MEMORY = 1.0
"""Duration for which references are kept; older images are not used [s]."""
LONGEST_INTERVAL = 0.2
"""Longest time over which an error of one image is integrated [s]."""
COMMAND_SPEED = 4.0
"""Largest speed of the command of visual servoing, over `safety.reference_speed`."""
MEASURED = (Status.OK, Status.HELD, Status.PARTIAL)
"""Status of an image that measured the tip."""


class Controller(Protocol):
    """Turns references into commands; (3,) arrays are [m, rad, rad]."""

    def step(self, reference: Floats, time: float) -> Floats:
        """Command of a control tick."""
        ...

    def update(self, features: Floats | None, captured_at: float) -> None:
        """Use the features of an image (4,) [px]; NaN or None for what was not found."""
        ...


class NoCompensation:
    """The command is the reference."""

    def step(self, reference: Floats, time: float) -> Floats:
        """See `Controller.step`."""
        return reference

    def update(self, features: Floats | None, captured_at: float) -> None:
        """See `Controller.update`."""


class Loop:
    """The loop of the package; held motion is re-engaged at once."""

    def __init__(self, config: Config) -> None:
        self._loop = HysteresisReduction(config)

    def step(self, reference: Floats, time: float) -> Floats:
        """See `Controller.step`."""
        return self._loop.step(reference, time=time)

    def update(self, features: Floats | None, captured_at: float) -> None:
        """See `Controller.update`."""
        self._loop.on_features(features, captured_at)
        if self._loop.supervision.reaction.rank >= Reaction.HOLD_MOTION.rank:
            self._loop.engage()


class VisualServoing:
    """Image-based integral control of the tip.

    The command is the reference u plus a correction k. An image captured at t, whose measured tip
    is q, changes it by

        dk = rate dt (u(t) - q),    |k| <= limit

    with the time dt since the image before, at most `LONGEST_INTERVAL`; a DOF that the image does
    not determine keeps its k. The command follows k with at most `safety.reference_speed`.

    The tip is the most probable one of the package's loop, which does not compensate and gets the
    commands as its reference: no image is lost to mirrored postures, and errors of the geometry
    are estimated as in profile `best`. A feature-based measurement by itself would be worse.

    Args:
        config: Of the loop; twice `safety.width_limit` is the limit.
        rate: (3,) [1/s].
    """

    def __init__(self, config: Config, rate: Floats) -> None:
        self._rate = rate
        self._limit = 2 * np.array(config.safety.width_limit)
        self._step_limit = np.array(config.safety.reference_speed) * config.control.period
        fast = tuple(COMMAND_SPEED * each for each in config.safety.reference_speed)
        measuring = config.replace(**{"safety.reference_speed": fast})
        self._loop = HysteresisReduction(measuring, compensate=False)
        self._references: deque[tuple[float, Floats]] = deque(
            maxlen=round(MEMORY / config.control.period)
        )
        self._target, self._applied = np.zeros(3), np.zeros(3)
        self._last: float | None = None

    def step(self, reference: Floats, time: float) -> Floats:
        """See `Controller.step`."""
        self._references.append((time, reference))
        change = self._target - self._applied
        self._applied = self._applied + np.clip(change, -self._step_limit, self._step_limit)
        return self._loop.step(reference + self._applied, time=time)

    def update(self, features: Floats | None, captured_at: float) -> None:
        """See `Controller.update`."""
        report = self._loop.on_features(features, captured_at)
        if self._loop.supervision.reaction.rank >= Reaction.HOLD_MOTION.rank:
            self._loop.engage()
        elapsed = 0.0 if self._last is None else captured_at - self._last
        self._last = captured_at
        if report.status not in MEASURED:
            return
        _, reference = min(self._references, key=lambda each: abs(each[0] - captured_at))
        change = self._rate * min(elapsed, LONGEST_INTERVAL) * (reference - report.state_estimate)
        target = self._target + np.where(report.observable, change, 0.0)
        self._target = np.clip(target, -self._limit, self._limit)


@dataclass(frozen=True)
class Calibration:
    """Gain and contact offsets of an instrument, for motions around the first command.

    Attributes:
        gain: (3,) travel of the tip over that of the command in contact.
        delta_minus: (3,) contact offsets, gain times input minus output [m, rad, rad].
        delta_plus: (3,) likewise.
    """

    gain: tuple[float, ...]
    delta_minus: tuple[float, ...]
    delta_plus: tuple[float, ...]


class ConstantCompensation:
    """Eqs. (2)-(3) with the true contact offsets and gain of each DOF, which nothing updates.

    Args:
        calibration: Of the instrument.
        free_gain: (3,) gain in the free zone, and largest gain.
    """

    def __init__(self, calibration: Calibration, free_gain: Floats) -> None:
        self._gain = np.array(calibration.gain)
        self._compensators = [
            Compensator(
                free_gain=float(free_gain[dof]),
                gain_limit=float(free_gain[dof]),
                delta_minus=calibration.delta_minus[dof],
                delta_plus=calibration.delta_plus[dof],
            )
            for dof in Dof
        ]
        self._start: Floats | None = None

    def step(self, reference: Floats, time: float) -> Floats:
        """See `Controller.step`."""
        if self._start is None:
            self._start = reference
        travel = reference - self._start
        scaled = [each.step(travel[dof]) for dof, each in zip(Dof, self._compensators, strict=True)]
        return np.asarray(self._start + np.array(scaled) / self._gain)

    def update(self, features: Floats | None, captured_at: float) -> None:
        """See `Controller.update`."""
