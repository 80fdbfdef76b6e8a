"""A robot of plays with sensors of every kind, and kinematics of its own."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from tautscope import PlayRig, Points, Pose, Tip
from tautscope.config import Config
from tautscope.loop.kinematics import TwoPlanes, rotation_matrix
from tautscope.loop.measurement import Measurement

Floats = NDArray[np.float64]
Sensor = Callable[[Floats, float, np.random.Generator], Measurement]
"""What is measured of a tip (n,) at a time [s]."""


class Arm:
    """Kinematics of two degrees of freedom, for `kinematics.kind = "play_rig:Arm"`."""

    def tip(self, q: Floats) -> tuple[Floats, Floats]:
        turned = rotation_matrix(np.array([0.0, 0.0, q[0]]))
        return turned @ np.array([0.1 + 0.02 * q[1], 0.03 * q[1], 0.0]), turned

    def points(self, q: Floats) -> Floats:
        return 100.0 * np.array([[1 + q[0], q[1]], [q[0] - q[1], 2 + q[1]]])


def by_joints(q: Floats, time: float, rng: np.random.Generator) -> Tip:
    """Every degree of freedom; one of them is lost from time to time."""
    values = q + rng.normal(0, 0.005, len(q))
    if len(q) > 1 and round(time, 3) % 0.1 == 0:
        values[0] = np.nan
    return Tip(values, time, 1e-4 * np.eye(len(q)) if rng.random() < 0.5 else None)


def by_quaternion(q: Floats, time: float, rng: np.random.Generator) -> Pose:
    position, _ = Arm().tip(q)
    turned = [0.0, 0.0, np.sin(q[0] / 2), np.cos(q[0] / 2)]
    covariance = np.diag([1e-6] * 3 + [1e-4] * 3)
    return Pose(position + rng.normal(0, 1e-3, 3), time, turned, covariance, sensor=1)


def by_position(q: Floats, time: float, rng: np.random.Generator) -> Pose:
    return Pose(Arm().tip(q)[0] + rng.normal(0, 1e-3, 3), time, sensor=2)


def by_points(q: Floats, time: float, rng: np.random.Generator) -> Points:
    pixels = Arm().points(q) + rng.normal(0, 0.5, (2, 2))
    if rng.random() < 0.2:
        pixels[1] = np.nan
    return Points(pixels, time - 0.02, sensor=3)


class TrackedPlanes:
    """A sensor of position and rotation matrix of a section that bends in two planes."""

    def __init__(self, config: Config) -> None:
        self._kinematics = TwoPlanes(config)

    def __call__(self, q: Floats, time: float, rng: np.random.Generator) -> Pose:
        position, turned = self._kinematics.tip(q)
        noise = rotation_matrix(rng.normal(0, 5e-3, 3))
        return Pose(position + rng.normal(0, 3e-4, 3), time, turned @ noise)


class SensorRig(PlayRig):
    """Plays with sensors, each of which measures in every fifth tick."""

    def __init__(self, config: Config, sensors: Sequence[Sensor] = (by_joints,)) -> None:
        super().__init__(config, [0.6 * dof.width_limit for dof in config.dof], seed=1)
        self._sensors = sensors

    def measure(self, tip: Floats, time: float) -> list[Measurement]:
        return [
            sensor(tip, time, self.rng)
            for index, sensor in enumerate(self._sensors)
            if self.ticks % 5 == index % 2  # several measurements in one tick, and one alone
        ]
