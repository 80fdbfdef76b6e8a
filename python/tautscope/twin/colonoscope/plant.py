"""The simulated colonoscope tip: drives, cables with friction, shaft and section in MuJoCo."""

import math

import mujoco
import numpy as np
from numpy.typing import NDArray

from tautscope.errors import ConfigError
from tautscope.twin.colonoscope.friction import DahlFriction
from tautscope.twin.colonoscope.model import (
    CABLES,
    LUMPS,
    SHAFT_LUMPS,
    TIMESTEP,
    build,
    cable_spring,
)
from tautscope.twin.colonoscope.parameters import SEGMENTS, ColonoscopeParameters

Floats = NDArray[np.float64]

_SETTLING = 1.0
"""Settling time in the start posture before a run [s]."""
_SLACK = -10.0
"""Length below which a spring that only pulls would push [m]."""
_UNSTABLE = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)
_KNOBS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
"""Angle of the drum of each cable over the two knobs."""


class Plant:
    """Two knobs and an insertion drive, and friction and elasticity between them and the tip.

    Friction of a mass of a cable follows the capstan equation T_in = T_out exp(mu theta)
    (Euler-Eytelwein; for tendons in sheaths: Kaneko, Yamashita, Tanie, IEEE ICRA 1991), in its
    differential form: with the tension T of the cable there and the angle theta of the sheath that
    the mass stands for,

        C = mu theta T + drag,

    of the mass next to the section with the section's own angle added. Friction of a joint is its
    friction without load plus a share of the sum of the four tensions, which press the links
    together. `DahlFriction` turns each C into a force.

    The state of the tip is (bend_x, bend_y, insertion) [rad, rad, m]: with the direction z of the
    tip and its angle a against the guide, (bend_x, bend_y) = a (z_x, z_y) / |(z_x, z_y)|, smooth
    also where the section is straight; insertion is the position of the section's base.

    Raises:
        ConfigError: The parameters are not a MuJoCo model.
    """

    def __init__(self, parameters: ColonoscopeParameters, period: float, start: Floats) -> None:
        self._parameters, self._period = parameters, period
        self._substeps = math.ceil(period / TIMESTEP - 1e-9)
        self._timestep = period / self._substeps
        try:
            text = build(parameters, self._timestep)
            self._model = mujoco.MjModel.from_xml_string(text)
        except (ValueError, IndexError) as error:
            raise ConfigError("parameters", parameters, f"a colonoscope ({error})") from error
        self._data = data = mujoco.MjData(self._model)
        self._base = SHAFT_LUMPS - 1
        self._tip = self._model.site("tip").id
        self._stiffness = cable_spring(parameters)
        # Views of MuJoCo's arrays. They have the order of the MJCF: shaft, cables, hinges.
        section = SHAFT_LUMPS + len(CABLES) * LUMPS
        shape = (len(CABLES), LUMPS + 1)
        self._bends = [
            np.array([self._model.joint(f"bend_{p}_{j}").qposadr[0] for j in range(SEGMENTS)])
            for p in "xy"
        ]
        lengths = self._model.tendon_lengthspring
        self._drive = lengths[0]
        self._pulls_beyond = lengths[SHAFT_LUMPS:, 1].reshape(shape)
        self._spring_lengths = data.ten_length[SHAFT_LUMPS:].reshape(shape)

        count = self._model.nv
        presliding, self._coulomb = np.empty(count), np.zeros(count)
        presliding[:SHAFT_LUMPS] = parameters.shaft_presliding
        presliding[SHAFT_LUMPS:section] = parameters.cable_presliding
        presliding[section:] = parameters.joint_presliding
        self._friction = DahlFriction(presliding, scalars=section)
        self._coulomb[:SHAFT_LUMPS] = parameters.shaft_friction / SHAFT_LUMPS
        self._cable_coulomb = self._coulomb[SHAFT_LUMPS:section].reshape(len(CABLES), LUMPS)
        self._joint_coulomb = self._coulomb[section:]
        self._joint_shape = np.repeat(parameters.friction_shape, 2)
        # Cables x+, y+, x-, y-: the planes alternate.
        self._slack = np.tile(parameters.dead_length, 2) / 2
        self._sheath_friction = np.tile(parameters.cable_friction, 2)
        self._capstan = np.empty((len(CABLES), LUMPS))
        self._drag = parameters.cable_drag / LUMPS
        self._speed_limit = np.array(parameters.speed_limit)
        self._time = -_SETTLING
        self._motor = np.array(start, dtype=np.float64)
        self._start()

    def step(self, command: Floats) -> None:
        """Simulate one control period; the motors follow the command (3,) [rad, rad, m].

        An unstable simulation is a `ConfigError`.
        """
        limit = self._speed_limit * self._period
        travel = np.minimum(np.maximum(command - self._motor, -limit), limit) / self._substeps
        self._update_sheaths()
        for _ in range(self._substeps):
            self._motor = self._motor + travel
            self._pull()
            self._rub()
            mujoco.mj_step(self._model, self._data)
        # MuJoCo starts anew when it happens.
        if any(self._data.warning[each].number for each in _UNSTABLE):
            when = f"unstable in the simulation at {self._time:.3f} s"
            raise ConfigError("parameters", when, "stiffnesses and friction that can be simulated")
        self._time += self._period

    @property
    def applied(self) -> Floats:
        """(3,) [rad, rad, m] positions of the motors."""
        return self._motor

    @property
    def true_state(self) -> Floats:
        """(3,) [rad, rad, m] state of the tip: bend_x, bend_y and insertion."""
        _, rotation = self.tip()
        x, y, z = rotation[:, 2]
        across = math.hypot(x, y)
        scale = math.atan2(across, z) / across if across > 1e-9 else 1.0
        return np.array([scale * x, scale * y, self._data.qpos[self._base]])

    def tip(self) -> tuple[Floats, Floats]:
        """Position (3,) [m] and rotation matrix (3, 3) of the tip in the guide's frame."""
        # After mj_step the positions of the bodies lag one step behind the joints.
        mujoco.mj_kinematics(self._model, self._data)
        rotation = self._data.site_xmat[self._tip].reshape(3, 3).copy()
        return self._data.site_xpos[self._tip].copy(), rotation

    @property
    def joint_angles(self) -> Floats:
        """(2, SEGMENTS) [rad] angles of the joints about the axes of bend_x and bend_y."""
        return np.stack([self._data.qpos[addresses] for addresses in self._bends])

    @property
    def tensions(self) -> Floats:
        """(4, LUMPS + 1) [N] tension of each spring of the cables, in the order of `CABLES`."""
        stretch = self._spring_lengths - self._pulls_beyond
        tensions: Floats = self._stiffness * np.maximum(stretch, 0.0)
        return tensions

    def _pull(self) -> None:
        """Set the lengths of the springs at the motors."""
        pulled_in = self._parameters.radius * (_KNOBS @ self._motor[:2])
        self._pulls_beyond[:, 0] = self._slack - pulled_in
        self._drive[:] = self._motor[2]

    def _update_sheaths(self) -> None:
        """Set friction coefficient times angle of the sheath at each mass of each cable."""
        angle = np.full(LUMPS, self._parameters.sheath_angle / LUMPS)
        angle[-1] += math.hypot(*self.joint_angles.sum(axis=1))
        self._capstan[:] = np.outer(self._sheath_friction, angle)

    def _rub(self) -> None:
        """Apply the friction of cables, joints and shaft for the displacement of the last step."""
        parameters, data = self._parameters, self._data
        tensions = self.tensions
        # Half the sum is the tension at a mass between two springs.
        at_masses = tensions[:, :-1] + tensions[:, 1:]
        self._cable_coulomb[:] = (self._capstan / 2) * at_masses + self._drag
        load = parameters.joint_load_friction * float(tensions[:, -1].sum())
        self._joint_coulomb[:] = (parameters.joint_friction + load) * self._joint_shape
        force = self._friction.step(data.qvel * self._timestep, self._coulomb)
        np.negative(force, out=data.qfrc_applied)

    def _start(self) -> None:
        """Set the unstrained start posture and let the instrument settle."""
        parameters, data, start = self._parameters, self._data, self._motor
        lengths = self._model.tendon_lengthspring[SHAFT_LUMPS:]
        lengths[:, 0] = _SLACK
        lengths[:, 1] = self._model.tendon_length0[SHAFT_LUMPS:]
        data.qpos[:SHAFT_LUMPS] = start[2]
        for addresses, bend in zip(self._bends, start[:2], strict=True):
            data.qpos[addresses] = bend / SEGMENTS
        pulled_in = parameters.radius * (_KNOBS @ start[:2])
        cables = slice(SHAFT_LUMPS, SHAFT_LUMPS + len(CABLES) * LUMPS)
        data.qpos[cables] = np.repeat(pulled_in, LUMPS)
        mujoco.mj_forward(self._model, data)
        for _ in range(round(_SETTLING / self._period)):
            self.step(start)
