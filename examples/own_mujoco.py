"""A MuJoCo model of your own as a robot: two joints, each behind an elastic cable with friction.

Run it with ``uv run python examples/own_mujoco.py``.
"""

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from tautscope import Sample, Tip, axes, run_experiment
from tautscope.report.operator_motion import motion_of

# A joint is up to friction / kp = 0.25 rad behind its motor. With MuJoCo's default solimpfriction
# friction gives way at rest, and the slack is gone within seconds.
MODEL = """
<mujoco>
  <option timestep="0.002" gravity="0 0 0" integrator="implicitfast"/>
  <default>
    <joint axis="0 0 1" damping="0.02" armature="0.001" frictionloss="0.25"
      solimpfriction="0.9999 0.9999 0.001"/>
    <geom type="capsule" size="0.01" mass="0.05"/>
    <position kp="1"/>
  </default>
  <worldbody>
    <body>
      <joint name="shoulder"/>
      <geom fromto="0 0 0 0.1 0 0"/>
      <body pos="0.1 0 0">
        <joint name="elbow"/>
        <geom fromto="0 0 0 0.1 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <position joint="shoulder"/>
    <position joint="elbow"/>
  </actuator>
</mujoco>
"""
CONFIG = axes(2, names=["shoulder", "elbow"], width_limit=0.8, range=(-1.5, 1.5)).replace(
    **{"control.period": 0.01}
)


class Arm:
    """Your model, and what measures its joints or its tip."""

    control_period = CONFIG.control.period

    def reset(self) -> Sample:
        """At rest in the middle."""
        self.model = mujoco.MjModel.from_xml_string(MODEL)
        self.data, self.rng = mujoco.MjData(self.model), np.random.default_rng(1)
        return self.step(np.zeros(2))

    def step(self, command: ArrayLike) -> Sample:
        """Move by a control period; the joints are measured with noise."""
        self.data.ctrl[:] = command
        mujoco.mj_step(self.model, self.data, 5)
        joints, time = self.data.qpos.copy(), self.data.time
        seen = Tip(joints + self.rng.normal(0, 0.005, 2), time)
        return Sample(time, np.array(command), true_state=joints, measurement=(seen,))

    def close(self) -> None:
        """Nothing to stop."""


if __name__ == "__main__":
    motion = motion_of(CONFIG, seed=3, duration=60.0)
    for how, compensate in (("without", False), ("with", True)):
        rms = run_experiment(Arm(), motion, CONFIG, compensate).tracking_rms()
        print(f"{how} tautscope the joints are off by {rms.round(3)} rad")
