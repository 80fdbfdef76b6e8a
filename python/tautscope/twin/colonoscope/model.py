"""The MuJoCo model (MJCF) of the colonoscope: shaft, bending section and four cables.

The world frame is the guide's: z along the guide, outwards; origin where the section's base is at
insertion 0. SI units.

Shaft: lumped masses on slides along z, joined by springs; the last one is the section's base.

Section: a chain of universal joints (two hinges) with unequal stiffness, so that the curvature is
constant only approximately. The order of the two hinges alternates, which cancels the roll that one
order accumulates.

Cables: each is a row of lumped masses in its sheath, joined by springs that only pull, and then a
spatial tendon from the last mass through holes in the links to the last link. Cable and sheath
move with the base, so that insertion does not pull a cable.

Friction is not in this file: `tautscope.twin.colonoscope.plant` applies it as forces.
"""

import math

from tautscope.twin.colonoscope.parameters import SEGMENTS, ColonoscopeParameters

TIMESTEP = 0.0025
"""Largest physics step [s]; the inertias below are chosen for it."""
CABLES = ("x_plus", "y_plus", "x_minus", "y_minus")
"""In the order of their azimuth, 0, 90, 180 and 270 degrees."""
LUMPS = 3
"""Number of masses of a cable in its sheath."""
SHAFT_LUMPS = 5
"""Number of masses of the shaft, with the section's base."""

# The motion is quasi-static. Inertias are raised (armature) until the stiffest mode has a natural
# frequency of _MODE / TIMESTEP; MuJoCo integrates springs explicitly, which is stable below 2.
_MODE = 1.1
_REACH = 0.02
"""Distance from the section's base to the last mass of a cable [m]; no force depends on it."""
_GAP = 0.125
"""Distance from a joint to the next hole on either side, over the length of a link.

Between two holes a cable runs straight, so that opposite cables together shorten by
4 g l (1 - cos(a/2)) at each joint, with the gap g, the length l of a link and the joint's angle a.
"""


def cable_spring(parameters: ColonoscopeParameters) -> float:
    """Stiffness of each of the LUMPS + 1 springs of a cable in series [N/m]."""
    return parameters.cable_stiffness * (LUMPS + 1)


def build(parameters: ColonoscopeParameters, timestep: float) -> str:
    """Build the MJCF text for parameters and a time step [s]."""
    return f"""
<mujoco>
<compiler angle="radian"/>
<option timestep="{timestep}" integrator="implicitfast" gravity="0 {-parameters.gravity} 0">
  <flag contact="disable" constraint="disable"/></option>
<worldbody>
  {"".join(_shaft_mass(parameters, i) for i in range(SHAFT_LUMPS))}
</worldbody>
<tendon>
  {"".join(_shaft_spring(parameters, i) for i in range(SHAFT_LUMPS))}
  {"".join(_cable(parameters, name) for name in CABLES)}
</tendon>
</mujoco>"""


def _mass_for(stiffness: float) -> float:
    """Inertia beside which a stiffness has the natural frequency _MODE / TIMESTEP."""
    return stiffness * (TIMESTEP / _MODE) ** 2


def _damping_for(stiffness: float, ratio: float) -> float:
    return 2 * ratio * math.sqrt(stiffness * _mass_for(stiffness))


def _shaft_mass(parameters: ColonoscopeParameters, index: int) -> str:
    """A mass of the shaft, at the base's place for simplicity; the last one is the base."""
    inertia = _mass_for(4 * parameters.shaft_stiffness * SHAFT_LUMPS)
    last = index == SHAFT_LUMPS - 1
    return f"""<body name="shaft_{index}">
      <joint name="shaft_{index}" type="slide" axis="0 0 1" armature="{inertia}"/>
      <geom type="sphere" size="0.001" mass="0.01"/>
      {_base(parameters) if last else ""}</body>"""


def _shaft_spring(parameters: ColonoscopeParameters, index: int) -> str:
    stiffness = parameters.shaft_stiffness * SHAFT_LUMPS
    before = f'<joint joint="shaft_{index - 1}" coef="-1"/>' if index else ""
    return f"""<fixed name="shaft_{index}" stiffness="{stiffness}" springlength="0"
      damping="{_damping_for(stiffness, 1.0)}">
      {before}<joint joint="shaft_{index}" coef="1"/></fixed>"""


def _base(parameters: ColonoscopeParameters) -> str:
    return (
        _holes(parameters, "before_0", (0.5 - _GAP) * parameters.length / SEGMENTS)
        + "".join(_lumps(parameters, name) for name in CABLES)
        + _links(parameters)
    )


def _place(parameters: ColonoscopeParameters, name: str, z: float) -> str:
    azimuth = CABLES.index(name) * math.pi / 2 + parameters.routing_twist
    return f"{parameters.radius * math.cos(azimuth)} {parameters.radius * math.sin(azimuth)} {z}"


def _holes(parameters: ColonoscopeParameters, place: str, z: float) -> str:
    return "".join(
        f'<site name="{name}_{place}" pos="{_place(parameters, name, z)}"/>' for name in CABLES
    )


def _lumps(parameters: ColonoscopeParameters, name: str) -> str:
    """The masses of a cable; positive displacement is towards the handle."""
    inertia = _mass_for(4 * cable_spring(parameters))
    return "".join(
        f"""<body name="{name}_{i}" pos="{_place(parameters, name, -_REACH)}">
          <joint name="{name}_{i}" type="slide" axis="0 0 -1" armature="{inertia}"/>
          <geom type="sphere" size="0.0002" mass="1e-5"/>
          <site name="{name}_lump_{i}"/></body>"""
        for i in range(LUMPS)
    )


def _links(parameters: ColonoscopeParameters) -> str:
    """Links with half a link before the first joint and after the last, then the rigid tip."""
    link = parameters.length / SEGMENTS
    # Two opposite cables act on all joints of a plane at once.
    cables = 2 * cable_spring(parameters) * parameters.radius**2 * SEGMENTS
    inertia = _mass_for(cables + parameters.stiffness * SEGMENTS)
    share = parameters.mass / (SEGMENTS + 1)
    text = ""
    for j in range(SEGMENTS):
        stiffness = parameters.stiffness * SEGMENTS * parameters.stiffness_shape[j]
        hinges = [
            f"""<joint name="{name}_{j}" type="hinge" axis="{axis}" stiffness="{stiffness}"
              damping="{0.02 * parameters.stiffness * SEGMENTS}" armature="{inertia}"/>"""
            for name, axis in (("bend_x", "0 1 0"), ("bend_y", "-1 0 0"))
        ]
        text += f"""<body name="link_{j}" pos="0 0 {link if j else link / 2}">
          {"".join(hinges[:: -1 if j % 2 else 1])}
          <geom type="sphere" size="0.004" mass="{share}"/>
          {_holes(parameters, f"after_{j}", _GAP * link)}
          {_holes(parameters, f"before_{j + 1}", (1 - _GAP) * link) if j < SEGMENTS - 1 else ""}"""
    tip = f"""<site name="tip" pos="0 0 {link / 2 + parameters.tip_length}"/>
      <geom type="sphere" size="0.004" pos="0 0 {link / 2 + parameters.tip_length / 2}"
        mass="{share}"/>"""
    return text + tip + "</body>" * SEGMENTS


def _cable(parameters: ColonoscopeParameters, name: str) -> str:
    """Springs from drum to the section's end; `plant` sets the lengths beyond which they pull."""
    stiffness = cable_spring(parameters)
    spring = f'stiffness="{stiffness}" damping="{_damping_for(stiffness, 0.1)}"'
    text = ""
    for i in range(LUMPS):
        before = f'<joint joint="{name}_{i - 1}" coef="1"/>' if i else ""
        text += f"""<fixed name="{name}_{i}" {spring}>
          {before}<joint joint="{name}_{i}" coef="-1"/></fixed>"""
    holes = [f"{side}_{j}" for j in range(SEGMENTS) for side in ("before", "after")]
    places = [f"lump_{LUMPS - 1}", *holes]
    path = "".join(f'<site site="{name}_{place}"/>' for place in places)
    return f'{text}<spatial name="{name}_section" {spring}>{path}</spatial>'
