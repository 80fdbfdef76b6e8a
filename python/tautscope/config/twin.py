"""The simulated rig."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta, Struct, field

from tautscope.config.fields import NonNegative, Positive

DISTURBANCES = (
    "highlights",
    "debris",
    "smoke",
    "inset",
    "stool",
    "text",
    "exposure",
    "white_balance",
    "motion_blur",
    "partial",
    "touching",
    "no_instrument",
)
"""Allowed names in `twin.disturb`; `tautscope.twin.disturbances` describes them."""


class ShaftConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The shaft of the twin in the channel of the scope; the loop does not know it.

    All [ours], chosen such that the loops have the article's widths (Table 1).
    """

    segments: Annotated[int, Meta(ge=8, le=64)] = 8
    """Rigid segments of the shaft."""
    axial_stiffness: Positive = 4.0e3
    """Axial stiffness of each coupling, motor to first segment included [N/m]."""
    axial_damping: NonNegative = 40.0
    """Axial damping of each coupling [N s/m]."""
    torsional_stiffness: Positive = 0.033
    """Torsional stiffness of each coupling [N m/rad]."""
    torsional_damping: NonNegative = 4e-4
    """Torsional damping of each coupling [N m s/rad]."""
    friction: Positive = 0.5
    """Coulomb coefficient between shaft and wall."""
    straight_load: Positive = 0.2
    """Force of each segment on the wall of a straight scope [N]."""
    load_per_bend: NonNegative = 0.2
    """Increase of that force per bend of the scope [N]."""
    load_spread: Annotated[float, Meta(ge=0, le=0.3)] = 0.05
    """Relative standard deviation of that force between segments; random, from the seed."""
    wall_viscosity: tuple[NonNegative, NonNegative] = (4.0, 13.0)
    """Viscous friction of the wet wall on the surface of each segment, along the axis and around it
    [N s/m]; a few per cent of the friction at the speeds of the article's experiment."""
    liner_stiffness: tuple[Positive, Positive] = (6e3, 40e3)
    """Stiffness of the channel's wall, along the axis and around it [N/m]."""
    set_torque: NonNegative = 2e-4
    """Amplitude of the torque on each segment of a shaft with permanent set in a bent channel,
    sinusoidal in its angle [N m]."""
    set_angle: float = 1.2
    """Angle at which that torque is zero [rad]."""


class CableConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The bending section of the twin and its two antagonistic cables. All [ours]."""

    joints: Annotated[int, Meta(ge=10, le=64)] = 12
    """Joints of the bending section."""
    joint_stiffness: Positive = 0.003
    """Stiffness of a joint [N m/rad]."""
    joint_friction: NonNegative = 1.5e-3
    """Friction of a joint [N m]."""
    joint_spread: Annotated[float, Meta(ge=0, le=0.3)] = 0.03
    """Relative standard deviation of friction between joints; random, from the seed. It makes the
    curvature vary along the section."""
    arm: Positive = 1.2e-3
    """Distance of each cable from the section's axis [m]."""
    lumps: Annotated[int, Meta(ge=2, le=16)] = 3
    """Sliding masses that model one cable in its sheath."""
    stiffness: Positive = 45e3
    """Stiffness of each piece of cable between drum, lumps and section [N/m]; no compression."""
    damping: NonNegative = 100.0
    """Damping of each piece of cable [N s/m]."""
    friction: NonNegative = 1.0
    """Friction of each lump in the sheath [N]."""
    slack: NonNegative = 0.15e-3
    """Slack of each cable when drum and section have the same angle [m]."""


class DriveConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The position servos of the twin. All [ours]."""

    speed_limit: tuple[Positive, Positive, Positive] = (0.15, 20.0, 10.0)
    """Speed limit [m/s, rad/s, rad/s]."""
    encoder_step: tuple[Positive, Positive, Positive] = (1e-6, 1e-4, 1e-4)
    """One encoder count, at the instrument [m, rad, rad]."""


class TwinConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The twin: physics, drives and camera of the simulated rig. All [ours]."""

    seed: Annotated[int, Meta(ge=0)] = 0
    """Seed of all random numbers; the same seed gives the same bytes."""
    bends: Annotated[float, Meta(ge=0, le=6)] = 4.0
    """Bends of the endoscope; the wall force on the shaft is proportional (0 is straight)."""
    frame_rate: Positive = 25.0
    """Images per second [paper: PAL]."""
    latency: NonNegative = 0.08
    """Mean time from capture to arrival of a frame [s]."""
    latency_jitter: NonNegative = 0.01
    """Half the width of the uniform distribution of the latency [s]; at most `latency`."""
    image_noise: NonNegative = 2.0
    """Standard deviation of the sensor noise [grey levels]."""
    background: str | None = None
    """Folder of images to use as tissue; by default procedural mucosa."""
    disturb: tuple[str, ...] = ()
    """Names of image disturbances, in any order."""
    shaft: ShaftConfig = field(default_factory=ShaftConfig)
    cables: CableConfig = field(default_factory=CableConfig)
    drives: DriveConfig = field(default_factory=DriveConfig)
