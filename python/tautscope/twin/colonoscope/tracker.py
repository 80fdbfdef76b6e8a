"""The simulated electromagnetic (EM) tracker of the tip: rate, delay, noise and drift."""

from collections import deque

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.loop.measurement import Pose

Floats = NDArray[np.float64]

RATE = 40.0
"""Measurements per second [1/s], as NDI Aurora and 3D Guidance."""
POSITION_STD = 0.3e-3
"""Standard deviation of each coordinate of the position [m]."""
ORIENTATION_STD = 5e-3
"""Standard deviation of the rotation about each axis of the sensor [rad]."""
_DRIFT_PERIODS = (60.0, 180.0)
"""Range of the periods of the drift [s]."""


class EmTracker:
    """A sensor at the tip whose measurements arrive later.

    The sensor has five degrees of freedom: one coil measures position and direction, not the roll
    about itself. The orientation is therefore the rotation by the angle between z and the direction
    about the axis across both, which has no roll. Noise is white and Gaussian, in all three axes.
    The drift, as of a field distorted by metal that moves, is a slow sine per coordinate.

    The arguments are as of `ColonoscopeTwin`. A stamp is the arrival less the told delay, so that
    it is wrong by delay - told_delay.
    """

    def __init__(
        self,
        generator: np.random.Generator,
        delay: float,
        told_delay: float | None = None,
        drift: float = 0.0,
    ) -> None:
        self._generator = generator
        self._delay = delay
        self._stamp_error = 0.0 if told_delay is None else delay - told_delay
        self._drift = drift / np.sqrt(3)
        self._drift_rate = 2 * np.pi / generator.uniform(*_DRIFT_PERIODS, 3)
        self._drift_phase = generator.uniform(0, 2 * np.pi, 3)
        std = np.repeat([POSITION_STD, ORIENTATION_STD], 3)
        self._std = std
        self._in_transit: deque[tuple[float, Pose]] = deque()
        self._count = 0

    def is_due(self, time: float) -> bool:
        """Whether a measurement is to be taken at a time [s]."""
        # Half a millisecond of tolerance: n / RATE and n * period differ in the last digits.
        return time + 0.5e-3 >= self._count / RATE

    def measure(self, time: float, position: Floats, direction: Floats) -> None:
        """Measure the tip's position (3,) [m] and direction (3,), a unit vector, at a time [s]."""
        noise = self._std * self._generator.standard_normal(6)
        drift = self._drift * np.sin(self._drift_rate * time + self._drift_phase)
        pose = Pose(
            position + drift + noise[:3],
            time + self._stamp_error,
            without_roll(direction) @ cv2.Rodrigues(noise[3:])[0],
        )
        self._in_transit.append((time + self._delay, pose))
        self._count += 1

    def arrived(self, time: float) -> Pose | None:
        """The newest measurement that arrived since the last call, at a time [s]."""
        newest = None
        while self._in_transit and self._in_transit[0][0] <= time + 1e-9:
            newest = self._in_transit.popleft()[1]
        return newest


def without_roll(direction: Floats) -> Floats:
    """Rotation matrix (3, 3) that turns z into a direction (3,) about the axis across both.

    With the direction (x, y, z): [[1 - x x k, -x y k, x], [-x y k, 1 - y y k, y], [-x, -y, z]],
    k = 1/(1 + z). Wrong at -z, where there is no such axis.
    """
    x, y, z = direction
    k = 1 / (1 + z)
    return np.array([[1 - x * x * k, -x * y * k, x], [-x * y * k, 1 - y * y * k, y], [-x, -y, z]])
