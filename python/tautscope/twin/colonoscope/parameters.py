"""The numbers of a simulated colonoscope tip: geometry, stiffness, friction and drives."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

SEGMENTS = 8
"""Number of rigid links of the bending section, with a universal joint before each."""
SPREAD = 0.25
"""Half-width, over the default, of the range in which `drawn` changes most parameters."""
_SHAPE_SPREAD = 0.15
_MOST_TWIST = 0.06
# Friction over stiffness is the width in insertion; both spreads together are 25 %.
_SPREADS = {
    "stiffness": SPREAD,
    "joint_friction": SPREAD,
    "joint_load_friction": SPREAD,
    "cable_stiffness": SPREAD,
    "sheath_angle": SPREAD,
    "shaft_stiffness": 0.10,
    "shaft_friction": 0.15,
}


@dataclass(frozen=True, slots=True)
class ColonoscopeParameters:
    """A colonoscope's bending section, cables, shaft and drives.

    Stiffness and friction are set so that the hysteresis is about 0.4 rad wide in bending and 6 mm
    in insertion, and the tip is about 2 mm beside that of a section of constant curvature; lengths
    and tensions are about those of a colonoscope.

    Attributes:
        length: Of the bending section [m].
        tip_length: Of the rigid tip, from the section's end to the tracker's sensor [m].
        radius: Of the circle through the four cables, and of the drums of the knobs [m].
        routing_twist: Angle by which the four cables are turned about the section's axis, away
            from the planes x and y [rad].
        mass: Of section and tip [kg].
        stiffness: Bending moment over the section's angle [N m/rad].
        stiffness_shape: (SEGMENTS,) of each joint over the mean, proximal first.
        joint_friction: Coulomb friction of each joint without cable tension [N m].
        joint_load_friction: Coulomb friction of each joint over the sum of the four tensions that
            press the links together [m]: friction coefficient times radius of the joint.
        friction_shape: (SEGMENTS,) friction of each joint over the mean, proximal first.
        joint_presliding: Dahl's presliding angle of a joint [rad].
        cable_stiffness: Of one cable from drum to tip [N/m].
        cable_friction: (2,) friction coefficient of cable and sheath, of the cables of bend_x and
            of bend_y.
        sheath_angle: Sum of the sheath's bends from handle to section [rad].
        cable_drag: Friction of a cable in its sheath without tension [N].
        cable_presliding: Dahl's presliding distance of a cable [m].
        dead_length: (2,) length that the knob of bend_x, and that of bend_y, pulls in from the end
            of one cable's tension to the start of the opposite cable's, with a straight section
            [m]. Below zero it is a pretension.
        shaft_stiffness: Of the shaft along its axis [N/m].
        shaft_friction: Of the shaft in colon and guide, the sum along its length [N].
        shaft_presliding: Dahl's presliding distance of the shaft [m].
        speed_limit: Of the motors of bend_x, bend_y and insertion [rad/s, rad/s, m/s].
        gravity: Along -y, across the guide [m/s^2].
    """

    length: float = 0.080
    tip_length: float = 0.015
    radius: float = 0.005
    routing_twist: float = 0.03
    mass: float = 0.016
    stiffness: float = 0.03
    stiffness_shape: tuple[float, ...] = (1.10, 1.07, 1.04, 1.01, 0.985, 0.96, 0.93, 0.905)
    joint_friction: float = 0.030
    joint_load_friction: float = 0.6e-3
    friction_shape: tuple[float, ...] = (0.9, 1.1, 1.0, 1.05, 0.95, 1.0, 1.1, 0.9)
    joint_presliding: float = 0.008
    cable_stiffness: float = 17e3
    cable_friction: tuple[float, float] = (0.15, 0.15)
    sheath_angle: float = 3.0
    cable_drag: float = 0.3
    cable_presliding: float = 0.2e-3
    dead_length: tuple[float, float] = (1.0e-3, 1.0e-3)
    shaft_stiffness: float = 1.2e3
    shaft_friction: float = 6.3
    shaft_presliding: float = 0.3e-3
    speed_limit: tuple[float, float, float] = (4.0, 4.0, 0.1)
    gravity: float = 9.81

    @classmethod
    def drawn(cls, seed: int) -> ColonoscopeParameters:
        """The parameters of the colonoscope with a number; the same number gives the same one.

        Of section and cables, stiffness, friction, the sheath's angle and dead length are drawn
        evenly within 25 % of their defaults, and the shapes along the section within 15 % per
        joint; of the shaft, stiffness within 10 % and friction within 15 %; the twist of the
        cables within 0.06 rad to either side.
        """
        generator = np.random.default_rng([seed, 1])
        default = cls()
        change = {name: spread * generator.uniform(-1, 1) for name, spread in _SPREADS.items()}
        return replace(
            default,
            **{name: getattr(default, name) * (1 + x) for name, x in change.items()},
            cable_friction=_drawn(default.cable_friction, generator),
            dead_length=_drawn(default.dead_length, generator),
            stiffness_shape=_varied(default.stiffness_shape, generator),
            friction_shape=_varied(default.friction_shape, generator),
            routing_twist=float(generator.uniform(-_MOST_TWIST, _MOST_TWIST)),
        )


def _drawn(pair: tuple[float, float], generator: np.random.Generator) -> tuple[float, float]:
    x, y = (1 + SPREAD * generator.uniform(-1, 1, 2)).tolist()
    return pair[0] * x, pair[1] * y


def _varied(shape: tuple[float, ...], generator: np.random.Generator) -> tuple[float, ...]:
    """Shape with each joint changed; the mean stays one."""
    varied = np.array(shape) * (1 + _SHAPE_SPREAD * generator.uniform(-1, 1, len(shape)))
    return tuple((varied / varied.mean()).tolist())
