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
"""What `twin.disturb` may name; `tautscope.twin.disturbances` says what each does."""


class ShaftConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The twin's shaft in the scope's channel, unknown to the loop.

    All [ours], set so that the loops have the article's widths (Table 1).
    """

    segments: Annotated[int, Meta(ge=8, le=64)] = 8
    axial_stiffness: Positive = 4.0e3
    """Of each of the couplings, motor to first segment included [N/m]."""
    axial_damping: NonNegative = 40.0
    """[N s/m]."""
    torsional_stiffness: Positive = 0.033
    """[N m/rad]."""
    torsional_damping: NonNegative = 4e-4
    """[N m s/rad]."""
    friction: Positive = 0.5
    """Coulomb coefficient between shaft and wall."""
    straight_load: Positive = 0.2
    """Force of each segment on the wall in a straight scope [N]."""
    load_per_bend: NonNegative = 0.2
    """What each bend of the scope adds to it [N]."""
    load_spread: Annotated[float, Meta(ge=0, le=0.3)] = 0.05
    """Standard deviation of a segment's share of the load, relative; drawn from the seed."""
    wall_viscosity: tuple[NonNegative, NonNegative] = (4.0, 13.0)
    """Of the wet wall on each segment's surface, along the axis and around it [N s/m]; a few
    per cent of the friction at the speeds of the article's experiment."""
    liner_stiffness: tuple[Positive, Positive] = (6e3, 40e3)
    """Of the channel's wall, dragged along the axis and around it [N/m]."""
    set_torque: NonNegative = 2e-4
    """A shaft that has taken a set turns unevenly in a bent channel: amplitude of the torque on
    each segment [N m], sinusoidal in its angle."""
    set_angle: float = 1.2
    """Angle at which that torque vanishes [rad]."""


class CableConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The twin's bending section and its two antagonistic cables. All [ours], as `ShaftConfig`."""

    joints: Annotated[int, Meta(ge=10, le=64)] = 12
    """Of the bending section."""
    joint_stiffness: Positive = 0.003
    """[N m/rad]."""
    joint_friction: NonNegative = 1.5e-3
    """[N m]."""
    joint_spread: Annotated[float, Meta(ge=0, le=0.3)] = 0.03
    """Standard deviation of a joint's friction, relative; drawn from the seed. It is what makes
    the curvature vary along the section."""
    arm: Positive = 1.2e-3
    """Distance of each cable from the section's axis [m]."""
    lumps: Annotated[int, Meta(ge=2, le=16)] = 3
    """Sliding masses that stand for one cable in its sheath."""
    stiffness: Positive = 45e3
    """Of each piece of cable between drum, lumps and section [N/m]; a cable cannot push."""
    damping: NonNegative = 100.0
    """[N s/m]."""
    friction: NonNegative = 1.0
    """Of each lump in the sheath [N]."""
    slack: NonNegative = 0.15e-3
    """Of each cable when the drum and the section agree [m]."""


class DriveConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The twin's position servos. All [ours]."""

    speed_limit: tuple[Positive, Positive, Positive] = (0.15, 20.0, 10.0)
    """[m/s, rad/s, rad/s]."""
    encoder_step: tuple[Positive, Positive, Positive] = (1e-6, 1e-4, 1e-4)
    """What one encoder count is at the instrument [m, rad, rad]."""


class TwinConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The physical twin: physics, drives and camera of the simulated rig. All [ours]."""

    seed: Annotated[int, Meta(ge=0)] = 0
    """Of everything random: same seed, same bytes."""
    bends: Annotated[float, Meta(ge=0, le=6)] = 4.0
    """Bends of the endoscope; the wall presses on the shaft in proportion (0 is straight)."""
    frame_rate: Positive = 25.0
    """Images per second [paper: PAL]."""
    latency: NonNegative = 0.08
    """From capture to arrival of a frame, mean [s]."""
    latency_jitter: NonNegative = 0.01
    """Largest deviation from the mean latency [s], uniform; not above latency."""
    image_noise: NonNegative = 2.0
    """Standard deviation of the sensor noise [grey levels]."""
    background: str | None = None
    """Folder of images to use as tissue instead of procedural mucosa."""
    disturb: tuple[str, ...] = ()
    """Disturbances of the pictures, by name; their order does not matter."""
    shaft: ShaftConfig = field(default_factory=ShaftConfig)
    cables: CableConfig = field(default_factory=CableConfig)
    drives: DriveConfig = field(default_factory=DriveConfig)
