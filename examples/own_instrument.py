"""An instrument of your own: five degrees of freedom with a gripper, six motors, two sensors.

Three tendons bend it in two planes; the wire of the gripper runs beside them: own_instrument.toml.
An EM tracker measures the tip, an encoder the jaw. ``uv run python examples/own_instrument.py``.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from tautscope import PlayRig, Pose, Tip, load_config, run_experiment
from tautscope.report.operator_motion import motion_of

CONFIG = load_config(Path(__file__).with_suffix(".toml"))


class Instrument(PlayRig):
    """Plays in place of your motors: a `step` of yours would move all six, and read the sensors."""

    def measure(self, tip: np.ndarray, time: float) -> Iterable[Pose | Tip]:
        """A pose of the tip 20 times per second, the jaw 50 times."""
        if self.ticks % 10 == 0:
            position, rotation = self.kinematics.tip(tip)
            yield Pose(position + self.rng.normal(0, 0.3e-3, 3), time, rotation)
        if self.ticks % 4 == 0:
            yield Tip([np.nan] * 4 + [tip[4] + self.rng.normal(0, 0.005)], time, sensor=1)


if __name__ == "__main__":
    motion = motion_of(CONFIG, seed=3, duration=35.0)
    for how, compensate in (("without", False), ("with", True)):
        rms = run_experiment(Instrument(CONFIG), motion, CONFIG, compensate).tracking_rms()
        print(f"{how} tautscope the tip is off by {rms.round(4)} rad (insertion in m)")
