"""A catheter of your own: two bending planes, and a tip that an EM tracker measures.

Run it with ``uv run python examples/own_catheter.py``.
"""

import numpy as np
from numpy.typing import ArrayLike
from tautscope import Pose, Sample, axes, run_experiment
from tautscope.loop.kinematics import TwoPlanes
from tautscope.report.operator_motion import motion_of

CONFIG = axes(2, names=["bend_x", "bend_y"], width_limit=1.0, range=(-2.0, 2.0)).replace(
    kinematics={"kind": "two_planes", "length": 0.06, "tip_length": 0.01}
)


class Catheter:
    """Your motors and your tracker in place of these plays and this noise."""

    control_period = 0.005

    def reset(self) -> Sample:
        """Straight, at rest."""
        self.ticks, self.tip, self.rng = 0, np.zeros(2), np.random.default_rng(1)
        return self.step(np.zeros(2))

    def step(self, command: ArrayLike) -> Sample:
        """Move; a pose of the tip 40 times per second."""
        motors = np.asarray(command)
        self.tip, self.ticks = np.clip(self.tip, motors - 0.3, motors + 0.3), self.ticks + 1
        time = self.ticks * self.control_period
        position, rotation = TwoPlanes(CONFIG).tip(self.tip)
        pose = Pose(position + self.rng.normal(0, 0.3e-3, 3), time, rotation)
        seen = (pose,) if self.ticks % 5 == 0 else ()
        return Sample(time, motors, true_state=self.tip, measurement=seen)

    def close(self) -> None:
        """Stop your motors."""


if __name__ == "__main__":
    motion = motion_of(CONFIG, seed=3, duration=60.0)
    for how, compensate in (("without", False), ("with", True)):
        rms = run_experiment(Catheter(), motion, CONFIG, compensate).tracking_rms()
        print(f"{how} tautscope the tip is off by {rms.round(3)} rad")
