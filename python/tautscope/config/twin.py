"""Configuration of the simulated rig."""

from typing import Annotated

from msgspec import Meta, field

from tautscope.config.fields import Angle, Coordinate, NonNegative, Positive, Rotation
from tautscope.config.section import Section, require, require_at_most, require_names

Small = Annotated[float, Meta(ge=0, le=10)]
Slope = Annotated[float, Meta(gt=-1, lt=1)]

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
"""Values of `twin.disturb`, described in `tautscope.twin.disturbances`."""


class ShaftConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The simulated shaft in the scope's channel.

    All [ours], chosen so that the hysteresis loops have the article's widths (Table 1).
    """

    segments: Annotated[int, Meta(ge=8, le=64)] = 8
    """Rigid segments of the shaft."""
    axial_stiffness: Positive = 4.0e3
    """Of each coupling, including that from the motor to the first segment [N/m]."""
    axial_damping: NonNegative = 40.0
    """Of each coupling [N s/m]."""
    torsional_stiffness: Positive = 0.033
    """Of each coupling [N m/rad]."""
    torsional_damping: NonNegative = 4e-4
    """Of each coupling [N m s/rad]."""
    friction: Positive = 0.5
    """Coulomb friction coefficient between shaft and wall."""
    straight_load: Positive = 0.2
    """Normal force of each segment on the wall in a straight scope [N]."""
    load_per_bend: NonNegative = 0.2
    """Increase of the normal force per bend of the scope [N]."""
    load_spread: Annotated[float, Meta(ge=0, le=0.3)] = 0.05
    """Relative standard deviation of the normal force over segments, drawn with the seed."""
    wall_viscosity: tuple[NonNegative, NonNegative] = (4.0, 13.0)
    """Viscous friction of each segment, axial and circumferential [N s/m]; a few per cent of the
    friction at the speeds of the article's experiment."""
    liner_stiffness: tuple[Positive, Positive] = (6e3, 40e3)
    """Stiffness of the channel's wall, axial and circumferential [N/m]."""
    set_torque: NonNegative = 2e-4
    """Amplitude of the torque on each segment, sinusoidal in its angle, by which a shaft with a
    permanent curvature (set) rotates unevenly in a bent channel [N m]."""
    set_angle: Angle = 1.2
    """Angle at which that torque is zero [rad]."""


class CableConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The simulated bending section with its two antagonistic cables. All [ours]."""

    joints: Annotated[int, Meta(ge=10, le=64)] = 12
    """Number of joints of the bending section."""
    joint_stiffness: Positive = 0.003
    """Stiffness of a joint [N m/rad]."""
    joint_friction: NonNegative = 1.5e-3
    """Coulomb friction torque [N m]."""
    joint_spread: Annotated[float, Meta(ge=0, le=0.3)] = 0.03
    """Relative standard deviation of the friction over joints, drawn with the seed; it makes the
    curvature vary along the section."""
    arm: Positive = 1.2e-3
    """Distance of each cable from the section's axis [m]."""
    lumps: Annotated[int, Meta(ge=2, le=16)] = 3
    """Number of lumped masses per cable."""
    stiffness: Positive = 45e3
    """Of each piece of cable between drum, masses and section [N/m]; a cable only pulls."""
    damping: NonNegative = 100.0
    """Of each piece of cable [N s/m]."""
    friction: NonNegative = 1.0
    """Coulomb friction of each mass in the sheath [N]."""
    slack: NonNegative = 0.15e-3
    """Slack of each cable when drum and section are at the same angle [m]."""
    curvature: tuple[Slope, Slope] = (0.0, 0.0)
    """Linear and quadratic variation of the curvature along the section, in which friction aside it
    is proportional to 1 + linear x + quadratic (3 x^2 - 1) / 2, but at least to 0.1; x from -1 at
    the proximal to 1 at the distal end."""
    plane: Angle = 0.0
    """Angle of the plane of bending at zero rotation [rad]."""
    compliance: Annotated[float, Meta(ge=0, le=1e-3)] = 0.0
    """Shortening of the section per tension of both cables [m/N]; the cables slacken with it. Below
    6.7e-6 none."""


class FrictionConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Variation of the friction of shaft and section, `tautscope.twin.friction`. All [ours]."""

    over_position: tuple[Slope, Slope] = (0.0, 0.0)
    """Of the shaft over insertion, of the section over bending [share]: amplitude of a sine with
    one period over the stroke of the article's experiment."""
    over_time: tuple[Slope, Slope] = (0.0, 0.0)
    """Of shaft and section [share]: amplitude of a sine over time."""
    time_period: Positive = 40.0
    """Period of that sine [s]."""
    stick: tuple[Small, Small] = (0.0, 0.0)
    """Increase of the friction of shaft and section at rest [share], which falls with speed: parts
    move by stick-slip."""


class TransmissionConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """From the motors to the proximal ends of shaft and cables, `tautscope.twin.transmission`.

    Values are for insertion, rotation, bending; the start posture is that of the experiment. All
    [ours].
    """

    gain: tuple[Positive, Positive, Positive] = (1.0, 1.0, 1.0)
    """Travel of the end over travel of the motor."""
    offset: Rotation = (0.0, 0.0, 0.0)
    """Position of the end minus that of the motor in the start posture [m, rad, rad]: the contact
    offsets become asymmetric."""
    slack: tuple[Small, Small, Small] = (0.0, 0.0, 0.0)
    """Travel of the motor about the start posture, in mid-stroke, that moves nothing
    [m, rad, rad]."""
    lag: tuple[Small, Small, Small] = (0.0, 0.0, 0.0)
    """Time constant by which the end follows the motor [s]."""


class SensorConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Timing, exposure and compression of the camera's images. All [ours]."""

    stamp_error: Coordinate = 0.0
    """Stamped minus true time of capture [s]."""
    readout: Small = 0.0
    """Time from the capture of the first to that of the last row (rolling shutter) [s]; at most one
    frame period. The stamp is the time of the middle row."""
    exposure_time_constant: Small = 0.0
    """Time constant of the automatic exposure [s]; 0 for a constant exposure."""
    exposure_target: Annotated[float, Meta(gt=0, lt=255)] = 105.0
    """Mean grey level that the automatic exposure aims at."""
    jpeg_quality: Annotated[int, Meta(ge=1, le=100)] | None = None
    """Quality of the JPEG compression of each image (MJPEG); None for none."""


class DriveConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The simulated position servos. All [ours]."""

    speed_limit: tuple[Positive, Positive, Positive] = (0.15, 20.0, 10.0)
    """Speed limit [m/s, rad/s, rad/s]."""
    encoder_step: tuple[Positive, Positive, Positive] = (1e-6, 1e-4, 1e-4)
    """Travel per encoder count at the instrument [m, rad, rad]."""


class TwinConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The digital twin: plant, drives and camera of the simulated rig. All [ours]."""

    seed: Annotated[int, Meta(ge=0)] = 0
    """Random seed; the same seed gives the same bytes."""
    bends: Annotated[float, Meta(ge=0, le=6)] = 4.0
    """Number of bends of the endoscope; each adds `load_per_bend` to the normal force."""
    frame_rate: Positive = 25.0
    """Images per second [paper: PAL]."""
    latency: NonNegative = 0.08
    """Mean time from capture to arrival of a frame [s]."""
    latency_jitter: NonNegative = 0.01
    """Largest difference from the mean latency, uniformly distributed [s]; at most the latency."""
    image_noise: NonNegative = 2.0
    """Standard deviation of the sensor noise [grey levels]."""
    background: str | None = None
    """Folder of background images; by default procedural mucosa."""
    disturb: tuple[str, ...] = ()
    """Names of image disturbances; their order does not matter."""
    shaft: ShaftConfig = field(default_factory=ShaftConfig)
    cables: CableConfig = field(default_factory=CableConfig)
    friction: FrictionConfig = field(default_factory=FrictionConfig)
    transmission: TransmissionConfig = field(default_factory=TransmissionConfig)
    drives: DriveConfig = field(default_factory=DriveConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)

    def _check(self) -> None:
        require_at_most("", self, "latency_jitter", "latency")
        require_names("disturb", self.disturb, DISTURBANCES)
        readout, frame_period = self.sensor.readout, 1 / self.frame_rate
        allowed = f"at most one frame period, {frame_period:.3g}"
        require(readout <= frame_period, "sensor.readout", readout, allowed)
