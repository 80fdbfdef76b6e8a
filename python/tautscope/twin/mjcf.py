"""The MuJoCo model (MJCF) of the simulated instrument: shaft, bending section and cables.

The world frame is the guide's: z along the channel, outwards; origin where the instrument leaves
the guide. SI units.

Shaft: segments on slides and hinges along the channel, coupled by axial and torsional springs,
each pressed on the channel's wall. One elliptic friction cone per contact couples axial and
circumferential friction: sliding in one direction lowers the friction in the other. The wall is
slightly compliant (liner), which rounds the hysteresis loops.

Section: a chain of hinges. Two cables run from a drum to the distal end of the chain; each is a row
of lumped masses with sheath friction, joined by springs that only pull.
"""

import math

import numpy as np
from numpy.typing import NDArray

from tautscope.config import CableConfig, Config, ShaftConfig

MAX_TIMESTEP = 0.005
"""Largest physics step [s]; the inertias below are chosen for it."""

SERVO_LAG = 0.01
"""Lag of the position servos [s], damping over stiffness; the drives feed it forward."""

# The motion is quasi-static. Inertias are larger than a real instrument's, to keep the natural
# frequency of the stiffest spring below 2/MAX_TIMESTEP; in the article's experiment inertial forces
# are below 1 % of friction (tests/twin/test_plant.py).
_SEGMENT_MASS = 0.08
_SEGMENT_INERTIA = 1e-6
_PRESS_MASS = 0.05
_WALL_MASS = 3.0
_LUMP_MASS = 2.0
_SECTION_INERTIA = 6e-4
_SHORTENING_MASS = 20.0
_LEAST_CURVATURE = 0.1


def shortens(cables: CableConfig) -> bool:
    """Whether tension shortens the section.

    A compliance whose slides would have a natural frequency above 1.5/MAX_TIMESTEP counts as none:
    below 6.7e-6 m/N. It would shorten the section by 0.03 mm at 5 N.
    """
    return cables.compliance * _SHORTENING_MASS * (1.5 / MAX_TIMESTEP) ** 2 > cables.joints


# Contacts and friction in MuJoCo are soft. These impedances make the creep below the friction limit
# small compared with the hysteresis, without chatter in the normal direction. The segments are
# light across the wall, so that the normal load does not depend on the slip.
_CONTACT = 'solref="0.02 1" solimp="0.9 0.9 0.001 0.5 2"'
_FRICTION = 'solreffriction="0.01 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"'
_IMPEDANCE_RATIO = 1000
# MuJoCo divides the solver's improvement by the mean inertia before it compares it with this.
# Beside 20 kg its default, 1e-8, ends the search before the friction of light parts is found.
_TOLERANCE = 1e-12
_INERT = 'contype="0" conaffinity="0"'


def build(config: Config, timestep: float) -> str:
    """Build the MJCF text for a configuration and a time step [s]."""
    shaft, cables = config.twin.shaft, config.twin.cables
    return f"""
<mujoco>
<compiler angle="radian"/>
<option timestep="{timestep}" integrator="implicitfast" cone="elliptic" jacobian="sparse"
  impratio="{_IMPEDANCE_RATIO}" tolerance="{_TOLERANCE}" gravity="0 0 0"/>
<default><geom size="0.001" mass="0.001" {_CONTACT}/></default>
<worldbody>
  {_drives()}
  {_wall(config)}
  {"".join(_segment(config, i) for i in range(shaft.segments))}
  {"".join(_lumps(cables, name) for name in "pn")}
</worldbody>
<tendon>
  {"".join(_coupling(shaft, i) for i in range(shaft.segments))}
  {_cable(cables, "p", 1)}
  {_cable(cables, "n", -1)}
</tendon>
<actuator>
  <position joint="motor_insertion" kp="5e4" kv="{5e4 * SERVO_LAG}"/>
  <position joint="motor_rotation" kp="1" kv="{SERVO_LAG}"/>
  <position joint="motor_bending" kp="10" kv="{10 * SERVO_LAG}"/>
</actuator>
</mujoco>"""


def _drives() -> str:
    kinds = (("insertion", "slide", 5), ("rotation", "hinge", 1e-4), ("bending", "hinge", 1e-3))
    return "".join(
        f"""<body name="motor_{name}">
          <joint name="motor_{name}" type="{kind}" axis="0 0 1" armature="{inertia}"/>
          <geom type="sphere" {_INERT}/></body>"""
        for name, kind, inertia in kinds
    )


def _wall(config: Config) -> str:
    shaft, radius = config.twin.shaft, config.instrument.diameter / 2
    along, around = shaft.liner_stiffness
    return f"""<body name="wall" pos="0 {-radius - 0.01} 0">
      <joint type="slide" axis="0 0 1" stiffness="{along}" damping="60"/>
      <joint type="slide" axis="1 0 0" stiffness="{around}" damping="60"/>
      <geom type="box" size="0.05 0.01 10" mass="{_WALL_MASS}" contype="2" conaffinity="1"
        friction="{shaft.friction} 0 0"/></body>"""


def _segment(config: Config, index: int) -> str:
    """A segment slides, turns and presses on the wall; the last one carries the section."""
    shaft = config.twin.shaft
    radius = config.instrument.diameter / 2
    along, around = shaft.wall_viscosity
    last = index == shaft.segments - 1
    return f"""<body name="segment_{index}" pos="0 0 {-0.1 * (shaft.segments - 1 - index)}">
      <joint name="slide_{index}" type="slide" axis="0 0 1" armature="{_SEGMENT_MASS}"
        damping="{along}"/>
      <joint name="press_{index}" type="slide" axis="0 1 0" armature="{_PRESS_MASS}"/>
      <joint name="turn_{index}" type="hinge" axis="0 0 1" armature="{_SEGMENT_INERTIA}"
        damping="{around * radius**2}"/>
      <geom type="sphere" size="{radius}" contype="1" conaffinity="2"
        condim="3" friction="{shaft.friction} 0 0"/>
      {_section(config) if last else ""}</body>"""


def curvature_shape(cables: CableConfig) -> NDArray[np.float64]:
    """Curvature at each joint over its mean, `CableConfig.curvature`."""
    (linear, quadratic), x = cables.curvature, np.linspace(-1, 1, cables.joints)
    shape = np.maximum(1 + linear * x + quadratic * (3 * x**2 - 1) / 2, _LEAST_CURVATURE)
    return np.asarray(shape / shape.mean())


def _section(config: Config) -> str:
    """A chain of hinges with half a rigid link at either end, then the rigid tip.

    Under a pure moment each hinge turns by moment over stiffness, so that the stiffness sets how
    the curvature varies.
    """
    cables, instrument = config.twin.cables, config.instrument
    link = instrument.bending_length / cables.joints
    stiffness = cables.joint_stiffness / curvature_shape(cables)
    axis = f"{0.0 - math.sin(cables.plane)} {math.cos(cables.plane)} 0"
    bodies = "".join(
        f"""<body name="joint_{j}" pos="0 0 {link if j else link / 2}">
          {_shortening(cables, j)}
          <joint name="bend_{j}" type="hinge" axis="{axis}" stiffness="{stiffness[j]}"
            damping="2e-4" armature="{_SECTION_INERTIA / cables.joints}"
            frictionloss="{cables.joint_friction}" {_FRICTION}/>
          <geom type="sphere" mass="1e-4" {_INERT}/>"""
        for j in range(cables.joints)
    )
    tip = f"""<body name="tip" pos="0 0 {link / 2}">
      <geom type="capsule" fromto="0 0 0 0 0 {instrument.tip_length}" {_INERT}/></body>"""
    return bodies + tip + "</body>" * cables.joints


def _shortening(cables: CableConfig, index: int) -> str:
    """A slide against a spring, by which tension shortens a link."""
    if not shortens(cables):
        return ""
    stiffness = cables.joints / cables.compliance
    return f"""<joint name="shorten_{index}" type="slide" axis="0 0 -1" stiffness="{stiffness}"
      damping="{math.sqrt(stiffness * _SHORTENING_MASS)}" armature="{_SHORTENING_MASS}"/>"""


def _lumps(cables: CableConfig, name: str) -> str:
    return "".join(
        f"""<body name="cable_{name}{i}">
          <joint name="cable_{name}{i}" type="slide" axis="0 0 1"
            frictionloss="{cables.friction}" {_FRICTION}/>
          <geom type="sphere" mass="{_LUMP_MASS}" {_INERT}/></body>"""
        for i in range(cables.lumps)
    )


def _coupling(shaft: ShaftConfig, index: int) -> str:
    def spring(joint: str, motor: str, stiffness: float, damping: float) -> str:
        before = f"{joint}_{index - 1}" if index else motor
        return f"""<fixed stiffness="{stiffness}" damping="{damping}">
          <joint joint="{before}" coef="1"/><joint joint="{joint}_{index}" coef="-1"/></fixed>"""

    return spring("slide", "motor_insertion", shaft.axial_stiffness, shaft.axial_damping) + spring(
        "turn", "motor_rotation", shaft.torsional_stiffness, shaft.torsional_damping
    )


def _cable(cables: CableConfig, name: str, sign: int) -> str:
    """Drum, lumped masses and section in series; each spring pulls beyond its slack length."""
    drum = [f'<joint joint="motor_bending" coef="{sign * cables.arm}"/>']
    section = "".join(
        f'<joint joint="bend_{j}" coef="{-sign * cables.arm}"/>' for j in range(cables.joints)
    )
    if shortens(cables):
        section += "".join(f'<joint joint="shorten_{j}" coef="-1"/>' for j in range(cables.joints))
    starts = drum + [f'<joint joint="cable_{name}{i}" coef="1"/>' for i in range(cables.lumps)]
    ends = [f'<joint joint="cable_{name}{i}" coef="-1"/>' for i in range(cables.lumps)] + [section]
    slacks = [0.0] * cables.lumps + [cables.slack]
    return "".join(
        f"""<fixed stiffness="{cables.stiffness}" damping="{cables.damping}"
          springlength="-1 {slack}">{start}{end}</fixed>"""
        for start, end, slack in zip(starts, ends, slacks, strict=True)
    )
