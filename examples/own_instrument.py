"""An instrument of your own: five degrees of freedom with a gripper, six motors, two sensors.

Three tendons bend it in two planes; the wire of the gripper runs beside them. An EM tracker sees
the tip, an encoder the jaw. Run it with ``uv run python examples/own_instrument.py``.
"""

import tomllib

import numpy as np
from numpy.typing import ArrayLike
from tautscope import Pose, Sample, Tip, run_experiment
from tautscope.config import from_document
from tautscope.loop.kinematics import TwoPlanes
from tautscope.report.operator_motion import motion_of

CONFIG = from_document(
    tomllib.loads("""
dof = [
    {name = "bend_x", width_limit = 1.0, range = [-1.2, 1.2]},
    {name = "bend_y", width_limit = 1.0, range = [-1.2, 1.2]},
    {name = "insertion", unit = "m", width_limit = 9e-3, range = [-0.03, 0.03], speed = 0.05},
    {name = "rotation", width_limit = 1.2, range = [-1.5, 1.5]},
    {name = "grip", width_limit = 0.6, range = [0.0, 1.0]},
]
[kinematics]
kind = "two_planes"
without = ["grip"]
[actuators]
names = ["tendon_1", "tendon_2", "tendon_3", "carriage", "drum", "wire"]
units = ["mm", "mm", "mm", "counts", "rad", "mm"]
matrix = [  # bend_x, bend_y, insertion, rotation, grip
    [3.0, 0.0, 0.0, 0.0, 0.0],
    [-1.5, 2.598, 0.0, 0.0, 0.0],
    [-1.5, -2.598, 0.0, 0.0, 0.0],
    [0.0, 0.0, 2e5, 0.0, 0.0],
    [0.0, 0.0, 0.0, -1.0, 0.0],
    [0.8, 0.0, 0.0, 0.0, 4.0],
]
offsets = [5.0, 5.0, 5.0, 0.0, 0.0, 1.0]
limits = [[0, 10], [0, 10], [0, 10], [-9000, 9000], [-3, 3], [-2, 9]]
""")
)
SLACK = np.array([0.6, 0.5, 5e-3, 0.7, 0.3])
BACK = np.linalg.pinv(CONFIG.actuators.matrix)


class Instrument:
    """Your motors and sensors in place of these plays and this noise."""

    control_period = 0.005

    def reset(self) -> Sample:
        """Straight and closed, at rest."""
        self.ticks, self.tip, self.rng = 0, np.zeros(5), np.random.default_rng(1)
        return self.step(CONFIG.actuators.offsets)

    def step(self, motors: ArrayLike) -> Sample:
        """Move the six motors; a pose of the tip 20 times per second, the jaw 50 times."""
        at = BACK @ np.subtract(motors, CONFIG.actuators.offsets)
        self.tip, self.ticks = np.clip(self.tip, at - SLACK / 2, at + SLACK / 2), self.ticks + 1
        time, noise, seen = self.ticks * self.control_period, self.rng.normal, []
        if self.ticks % 10 == 0:
            position, rotation = TwoPlanes(CONFIG).tip(self.tip)
            seen.append(Pose(position + noise(0, 0.3e-3, 3), time, rotation))
        if self.ticks % 4 == 0:
            jaw = [np.nan] * 4 + [self.tip[4] + noise(0, 0.005)]
            seen.append(Tip(jaw, time, sensor=1))
        return Sample(time, motors, true_state=self.tip, measurement=tuple(seen))

    def close(self) -> None:
        """Stop your motors."""


def main() -> None:
    motion = motion_of(CONFIG, seed=3, duration=35.0)
    without, with_it = (run_experiment(Instrument(), motion, CONFIG, on) for on in (False, True))
    rms = zip(CONFIG.dofs, without.tracking_rms(), with_it.tracking_rms(), strict=True)
    for dof, before, after in rms:
        print(f"{dof.label}: tip off by {before:.2g} {dof.unit}, with tautscope by {after:.2g}")


if __name__ == "__main__":
    main()
