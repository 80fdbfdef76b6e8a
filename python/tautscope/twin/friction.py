"""Friction that varies with position, time and speed."""

import numpy as np
from numpy.typing import NDArray

from tautscope.config import ExperimentConfig, FrictionConfig
from tautscope.dof import Dof

Floats = NDArray[np.float64]

SHAFT_SPEED = 2e-3
"""Speed of the shaft's surface over which `FrictionConfig.stick` falls to 1/e [m/s]."""
JOINT_SPEED = 0.02
"""The same of a joint of the section [rad/s]."""
CABLE_SPEED = 0.3e-3
"""The same of a cable in its sheath [m/s]."""


class FrictionVariation:
    """Factors on the Coulomb friction of the shaft and of the section.

        factor = (1 + p sin(pi x)) (1 + q sin(2 pi t / period)) (1 + s exp(-|v| / v_s))

    with p, q, s from `FrictionConfig`; x is the position of insertion or bending from the centre of
    the experiment's reference over its amplitude, t the time, v a speed of sliding, and v_s the
    constants above (Stribeck).
    """

    def __init__(self, config: FrictionConfig, experiment: ExperimentConfig) -> None:
        sines = experiment[Dof.INSERTION], experiment[Dof.BENDING]
        self._config = config
        self._centre = np.array([sine.centre for sine in sines])
        self._amplitude = np.array([sine.amplitude for sine in sines])
        strengths = (*config.over_position, *config.over_time, *config.stick)
        self.is_constant = not any(strengths)

    def factors(
        self, insertion: float, bending: float, time: float, speeds: tuple[Floats, Floats, Floats]
    ) -> tuple[Floats, Floats, Floats]:
        """Factors of the shaft's segments, the section's joints and the cables' masses.

        At an insertion [m], bending [rad] and time [s], by their speeds [m/s, rad/s, m/s].
        """
        config = self._config
        x = (np.array([insertion, bending]) - self._centre) / self._amplitude
        wave = np.sin(2 * np.pi * time / config.time_period)
        shaft, section = (1 + np.array(config.over_position) * np.sin(np.pi * x)) * (
            1 + np.array(config.over_time) * wave
        )
        (stick_shaft, stick_section), (segments, joints, masses) = config.stick, speeds
        return (
            shaft * (1 + stick_shaft * np.exp(-np.abs(segments) / SHAFT_SPEED)),
            section * (1 + stick_section * np.exp(-np.abs(joints) / JOINT_SPEED)),
            section * (1 + stick_section * np.exp(-np.abs(masses) / CABLE_SPEED)),
        )
