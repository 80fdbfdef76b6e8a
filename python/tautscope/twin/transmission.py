"""The path from the motors to the proximal ends of shaft and cables: gain, slack and lag."""

import numpy as np
from numpy.typing import NDArray

from tautscope.config import TransmissionConfig

Floats = NDArray[np.float64]


class Transmission:
    """Position of the proximal ends for a position of the motors.

    With the motor's travel x from the start posture, per DOF,

        target = start + offset + gain sign(x) max(|x| - slack / 2, 0)
        d(position)/dt = (target - position) / lag,    or position = target without lag

    It is in series with the servos, before friction and elasticity, because MuJoCo has neither a
    gap at one place of the stroke nor a lag that the encoder of the motor does not show.

    Attributes:
        position: Of the ends (3,) [m, rad, rad].
    """

    def __init__(self, config: TransmissionConfig, start: Floats) -> None:
        self._start = start
        self._gain, self._offset = np.array(config.gain), np.array(config.offset)
        self._half_slack, self._lag = np.array(config.slack) / 2, np.array(config.lag)
        self._is_direct = config == TransmissionConfig()
        self.position = start

    def step(self, motor: Floats, travel: Floats, duration: float) -> tuple[Floats, Floats]:
        """Position and travel (3,) of the ends when the motors (3,) have made a travel (3,)."""
        before = self.position
        if self._is_direct:
            self.position = motor
            return motor, travel
        x = motor - self._start
        moved = np.sign(x) * np.maximum(np.abs(x) - self._half_slack, 0.0)
        target = self._start + self._offset + self._gain * moved
        has_lag = self._lag > 0
        share = np.where(has_lag, -np.expm1(-duration / np.where(has_lag, self._lag, 1.0)), 1.0)
        self.position = before + share * (target - before)
        return self.position, self.position - before
