"""The simulated plant: drives, shaft, cables and bending section in MuJoCo."""

import math
from collections.abc import Iterable

import mujoco
import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.twin.friction import FrictionVariation
from tautscope.twin.mjcf import MAX_TIMESTEP, SERVO_LAG, build, curvature_shape
from tautscope.twin.transmission import Transmission

_SETTLING = 1.0
"""Settling time in the start posture before a run [s]."""
_UNSTABLE = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)


class Plant:
    """Drives, and the friction and elasticity between them and the tip.

    Attributes:
        bends: Number of bends of the scope; may be changed at any time.
        tip_force: Force on the distal end of the shaft, outwards [N]; may be changed at any time.
    """

    def __init__(self, config: Config, generator: np.random.Generator) -> None:
        shaft, cables = config.twin.shaft, config.twin.cables
        self._config = config
        self._substeps = math.ceil(config.control.period / MAX_TIMESTEP - 1e-9)
        self._timestep = config.control.period / self._substeps
        self._model = mujoco.MjModel.from_xml_string(build(config, self._timestep))
        self._data = mujoco.MjData(self._model)
        # Views: each look-up of an attribute of MjData makes an array anew.
        self._q, self._forces = self._data.qpos, self._data.qfrc_applied
        self._warnings = [self._data.warning[each] for each in _UNSTABLE]
        segments = range(shaft.segments)
        self._slides = self._addresses(f"slide_{i}" for i in segments)
        self._presses = self._addresses(f"press_{i}" for i in segments)
        self._turns = self._addresses(f"turn_{i}" for i in segments)
        self._hinges = self._addresses(f"bend_{j}" for j in range(cables.joints))
        self._motors = self._addresses(f"motor_{dof.label}" for dof in Dof)
        self._lumps = {
            name: self._addresses(f"cable_{name}{i}" for i in range(cables.lumps)) for name in "pn"
        }
        self._base = self._model.body(f"segment_{shaft.segments - 1}").id
        self._links = [self._model.body(f"joint_{j}").id for j in range(cables.joints)]
        self._tip = self._model.body("tip").id

        self._load_share = 1 + shaft.load_spread * generator.standard_normal(shaft.segments)
        spread = 1 + cables.joint_spread * generator.standard_normal(cables.joints)
        self._joint_friction = self._model.dof_frictionloss[self._hinges] * spread
        self.section_friction = 1.0
        self._speed_limit = np.array(config.twin.drives.speed_limit)
        self._encoder_step: NDArray[np.float64] = np.array(config.twin.drives.encoder_step)
        self._setpoint = np.array([config.experiment[dof].centre for dof in Dof])
        self._transmission = Transmission(config.twin.transmission, self._setpoint)
        self._variation = FrictionVariation(config.twin.friction, config.experiment)
        self._time = -_SETTLING
        self.bends = config.twin.bends
        self.tip_force = 0.0
        self._start()

    def step(self, command: NDArray[np.float64]) -> None:
        """Simulate one control period; the drives follow the command (3,) [m, rad, rad].

        Raises:
            ConfigError: The simulation is unstable.
        """
        data, shaft = self._data, self._config.twin.shaft
        load = shaft.straight_load + shaft.load_per_bend * self.bends
        self._forces[self._presses] = -load * self._load_share
        if not self._variation.is_constant:
            self._vary_friction()
        self._forces[self._slides[-1]] = self.tip_force
        limit = self._speed_limit * self._timestep
        for _ in range(self._substeps):
            travel = np.minimum(np.maximum(command - self._setpoint, -limit), limit)
            self._setpoint = self._setpoint + travel
            target, travel = self._transmission.step(self._setpoint, travel, self._timestep)
            data.ctrl[:] = target + travel * (SERVO_LAG / self._timestep)
            angles = self._q[self._turns] - shaft.set_angle
            self._forces[self._turns] = -shaft.set_torque * np.sin(angles)
            mujoco.mj_step(self._model, data)
        # MuJoCo starts anew when it happens.
        if any(warning.number for warning in self._warnings):
            when = f"unstable in the simulation at {self._time:.3f} s"
            raise ConfigError(
                "twin", when, "stiffnesses, masses and friction that can be simulated"
            )
        self._time += self._config.control.period

    def _vary_friction(self) -> None:
        """Apply the factors of `FrictionVariation` to loads and frictions."""
        config, model, speed = self._config, self._model, self._data.qvel
        lumps = np.concatenate(list(self._lumps.values()))
        around = config.instrument.diameter / 2 * speed[self._turns]
        insertion, _, bending = self.true_state
        shaft, joints, cables = self._variation.factors(
            insertion,
            bending,
            self._time,
            (np.hypot(speed[self._slides], around), speed[self._hinges], speed[lumps]),
        )
        self._forces[self._presses] *= shaft
        friction = self._section_friction * self._joint_friction
        model.dof_frictionloss[self._hinges] = joints * friction
        model.dof_frictionloss[lumps] = cables * config.twin.cables.friction

    @property
    def section_friction(self) -> float:
        """Factor on the friction of the section's joints; may be set."""
        return self._section_friction

    @section_friction.setter
    def section_friction(self, value: float) -> None:
        self._section_friction = value
        self._model.dof_frictionloss[self._hinges] = value * self._joint_friction

    @property
    def applied(self) -> NDArray[np.float64]:
        """Position (3,) [m, rad, rad] that the encoders measure, in whole counts."""
        ends: NDArray[np.float64] = self._q[self._motors]
        position = ends + (self._setpoint - self._transmission.position)
        return self._encoder_step * np.round(position / self._encoder_step)

    @property
    def true_state(self) -> NDArray[np.float64]:
        """(3,) [m, rad, rad]: insertion at the guide, plane of bending, angle of the section."""
        q, plane = self._q, self._config.twin.cables.plane
        return np.array([q[self._slides[-1]], q[self._turns[-1]] + plane, q[self._hinges].sum()])

    def centreline(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Points [m] and unit tangents (n, 3) of the centreline in the guide's frame.

        They go from the guide's end to the end of the tip. The last segment penetrates the wall by
        0.1 to 0.4 mm, because MuJoCo's contacts are soft; that offset is removed.
        """
        # After mj_step the positions of the bodies lag one step behind the joints.
        mujoco.mj_kinematics(self._model, self._data)
        positions, rotations = self._data.xpos, self._data.xmat.reshape(-1, 3, 3)
        axes = rotations[[self._base, *self._links], :, 2]
        at_joints = axes[:-1] + axes[1:]
        at_joints /= np.linalg.norm(at_joints, axis=1, keepdims=True)
        along = np.array([0.0, 0.0, 1.0])
        ahead = rotations[self._tip][:, 2]
        end = positions[self._tip] + self._config.instrument.tip_length * ahead
        points = np.vstack(
            [np.zeros(3), positions[self._base], positions[self._links], positions[self._tip], end]
        )
        points[1:, 1] -= points[1, 1]
        return points, np.vstack([along, axes[0], at_joints, ahead, ahead])

    def _start(self) -> None:
        """Set the unstrained start posture and let the instrument settle."""
        config, q = self._config, self._q
        start = self._setpoint
        insertion, rotation, bending = start
        q[self._slides], q[self._turns] = insertion, rotation
        q[self._hinges] = bending / len(self._hinges) * curvature_shape(config.twin.cables)
        q[self._motors] = start
        for name, sign in (("p", 1), ("n", -1)):
            q[self._lumps[name]] = sign * config.twin.cables.arm * bending
        for _ in range(round(_SETTLING / config.control.period)):
            self.step(start)

    def _addresses(self, names: Iterable[str]) -> NDArray[np.intp]:
        """Indices of the named joints in the state vectors (each joint has one coordinate)."""
        return np.array([self._model.joint(name).qposadr[0] for name in names], dtype=np.intp)
