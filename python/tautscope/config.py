"""Configuration: TOML in, frozen structures out. The single source of every default.

Each default carries its unit and, in brackets, its origin: [paper] is Reilink et al. 2013,
[ours] is chosen here, [geometry] is a plausible instrument (shared by no publication).
SI units throughout: m, rad, s; px for images.
"""

from __future__ import annotations

import math
import re
import tomllib
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import tomli_w
from msgspec import Meta, Struct, field

from tautscope.dof import Dof
from tautscope.errors import ConfigError, MissingPathError

Positive = Annotated[float, Meta(gt=0)]
NonNegative = Annotated[float, Meta(ge=0)]
Fraction = Annotated[float, Meta(gt=0, lt=1)]
Gain = Annotated[float, Meta(ge=1)]
PixelFormat = Literal["bgr", "rgb", "bgra", "yuyv", "uyvy", "nv12", "i420"]
Profile = Literal["paper", "best"]
ImageFormat = Literal["png", "jpeg"]
Deinterlace = Literal["bwdif", "none"]
CameraClock = Literal["stream", "device", "arrival"]
Vector3 = tuple[float, float, float]
Vector8 = tuple[float, float, float, float, float, float, float, float]

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


class DofConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One degree of freedom: its compensator, Eqs. (2)-(3), and estimator, Eqs. (4)-(6)."""

    update_distance: Positive
    """tau: command travel between two estimator updates [m or rad]; about 1 % of the stroke."""
    observable_deviation: Positive
    """Largest standard deviation of the state per px of marker noise [m/px or rad/px] at which
    the DOF counts as observable; beyond it the DOF is held."""
    start_deviation: Positive
    """How far the tip may be from the reference before the first image: standard deviation [m or
    rad]; about half the slack [ours]."""
    free_gain: Gain = 5.0
    """K_b: command over reference while the slack is crossed [paper]."""
    gain_limit: Gain = 5.0
    """Upper bound of every gain; free_gain may not exceed it [paper]."""
    recovery: Annotated[float, Meta(ge=0, lt=1)] = 0.0
    """Share of the reference's travel by which the command gives back what changed offsets have
    left between it and the reference; 0 keeps it [paper]."""
    contact_tolerance: Fraction = 0.4
    """epsilon in Eq. (4) [ours]."""
    smoothing_factor: Fraction = 0.25
    """alpha in Eq. (6), per update_distance travelled [ours]."""
    delta_minus: float = 0.0
    """Contact offset at the start [m or rad] [paper]."""
    delta_plus: float = 0.0
    """Contact offset at the start [m or rad], not below delta_minus [paper]."""


class AdaptiveConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Profile ``best``: lead law, contact and offsets over position. All [ours].

    Lengths are in units of the DOF's update_distance, so that one set serves all three.
    free_gain, gain_limit, delta_minus and delta_plus are those of `DofConfig`.
    """

    contact_gain: Gain = 2.0
    """Largest speed of the tip over that of the reference in contact, until the lead is what it
    should be."""
    cautious_gain: Gain = 1.4
    """The same for a stroke that begins with an offset hardly known."""
    cautious_deviation: Positive = 12.0
    """Standard deviation of an offset from which on it counts as hardly known. The free zone ends
    deviation^2 / cautious_deviation before the contact."""
    taper: Positive = 4.0
    """End of the gap over which free_gain falls to contact_gain."""
    settling: Positive = 1.5
    """Lead yet missing below which the gain in contact falls to 1; an offset's standard deviation
    comes on top."""
    tremor_time: NonNegative = 0.15
    """Time constant of the smoothing that tells tremor from intention [s]."""
    node_spacing: Positive = 6.0
    """Distance of two of the 33 positions at which an offset is held."""
    level_deviation: Positive = 20.0
    """Standard deviation of an offset at the start, the same error at all positions."""
    gain_deviation: NonNegative = 0.0
    """Standard deviation of the command's travel over the tip's in contact, about 1; 0 takes them
    to be equal. 0.3 finds gains from 0.5 to 1 of an instrument whose scale is not known."""
    local_deviation: NonNegative = 0.7
    """Standard deviation of an offset's variation with position."""
    correlation: Positive = 40.0
    """Distance over which that variation is alike."""
    level_drift: NonNegative = 0.2
    """Standard deviation of the offset's change while the command travels 1."""
    gain_drift: NonNegative = 0.0003
    """The same of the command's travel over the tip's."""
    local_drift: NonNegative = 0.03
    """The same of its variation with position."""
    symmetry: Annotated[float, Meta(ge=0, lt=1)] = 0.8
    """Minus the correlation of the two offsets: friction moves both contacts outwards alike."""
    contact_distance: Positive = 3.0
    """Travel of the command over which it is seen whether the tip follows."""
    contact_moved: NonNegative = 3.0
    """How far the tip must have come in a stroke before contact counts."""
    slope_tolerance: Fraction = 0.25
    """Largest deviation from 1 of tip over command travel in contact."""
    model_deviation: Positive = 0.5
    """Standard deviation of a measured offset beyond the markers' noise."""
    state_correction: Annotated[float, Meta(ge=0, le=1)] = 1.0
    """Share of what an image says of the play state that is taken over; 0 leaves it to the
    model."""


class StateEstimationConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """State estimation of profile ``best``, decision 0018. All [ours]."""

    marker_deviation: Positive = 0.3
    """Of a marker that comes without a covariance: standard deviation [px]."""
    model_deviation: NonNegative = 0.3
    """What the model of the features is off by beyond the markers' covariance: standard deviation
    [px]."""
    sideways_deviation: NonNegative = 0.3e-3
    """How far the tip is displaced across the bend because the section does not bend evenly:
    standard deviation [m]."""
    outlier_distance: Positive = 4.0
    """Mahalanobis distance beyond which a marker is left out."""
    steps: Annotated[int, Meta(ge=1, le=100)] = 12
    """Gauss-Newton steps, at most."""
    rest_deviation: NonNegative = 0.25
    """How far a tip moves between two images while its command rests: standard deviation [in units
    of the DOF's update_distance]."""


class InstrumentConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Geometry of the instrument, Fig. 4. All [geometry]."""

    diameter: Positive = 3.5e-3
    """Outer diameter of shaft, section and tip [m]."""
    bending_length: Positive = 18.5e-3
    """Length of the bending section [m]."""
    tip_length: Positive = 20e-3
    """Length of the rigid tip [m]."""
    marker_a: NonNegative = 4e-3
    """Centre of the proximal band A, from the distal end of the bending section [m]."""
    marker_b: NonNegative = 16e-3
    """Centre of the distal band B, from the distal end of the bending section [m]."""
    band_length: Positive = 4e-3
    """Length of each band along the axis [m]."""


class PoseConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Pose of the guide (where the instrument leaves the scope) in the camera's frame."""

    translation: Vector3 = (13.5e-3, 14e-3, 15e-3)
    """Guide's origin in the camera's frame: x right, y down, z forward [m] [ours]."""
    rotation: Vector3 = (0.32, -0.26, 0.0)
    """Rotation vector, axis times angle [rad], that turns guide axes into camera axes; the
    guide's z axis is the channel's axis, outwards [ours]."""


class SourceConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where a camera's images come from, in FFmpeg's words. All [ours]."""

    url: str = "/dev/video0"
    """Device, file, ``pipe:0``, ``udp://...``, ``rtsp://...``, or a filter graph for lavfi."""
    format: str | None = "v4l2"
    """FFmpeg's input format: v4l2, dv, mpegts, lavfi, ...; left empty, it is guessed."""
    options: dict[str, str] = field(default_factory=dict)
    """FFmpeg's options of that format: ``video_size``, ``framerate``, ``input_format``, ..."""
    deinterlace: Deinterlace = "bwdif"
    """What becomes of interlaced frames: ``bwdif`` makes each field a frame, one frame late."""
    clock: CameraClock = "stream"
    """When a frame was captured: ``stream``, its time stamp put on our clock by the quickest of
    the frames of `clock_window`; ``device``, its time stamp as it is, the system's monotonic clock
    (V4L2); ``arrival``, when it arrived, for a source without time stamps."""
    clock_window: Positive = 10.0
    """[s]."""
    delay: NonNegative = 0.0
    """From exposure to time stamp for ``device``, else of the quickest frame from exposure to
    arrival [s]; to be measured, since none of these can tell."""
    timeout: Positive = 2.0
    """Without a frame for so long a source is lost, and opened anew [s]."""
    reconnect_period: Positive = 0.5
    """Between two attempts to open it [s]."""
    start_timeout: Positive = 10.0
    """For the frames of the self-test at the start [s]."""
    lost_timeout: Positive = 5.0
    """Without a frame for so long a run on hardware ends, and the motors stop [s]."""
    darkest: Annotated[int, Meta(ge=1, le=255)] = 24
    """A picture without a pixel above this is black [grey levels]; video black is 16."""


class CameraConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Pinhole with OpenCV's distortion, Eq. (8)."""

    width: Annotated[int, Meta(ge=1, le=8192)] = 720
    """[px], PAL DV [paper]."""
    height: Annotated[int, Meta(ge=1, le=8192)] = 576
    """[px], PAL DV [paper]."""
    pixel_format: PixelFormat = "bgr"
    """Layout of the 8-bit pixels; the YUV formats in BT.601 with limited range, the width even, in
    nv12 and i420 the height too."""
    fx: Positive = 424.0
    """Focal length along x [px] [public colonoscope calibration]."""
    fy: Positive = 454.0
    """Focal length along y [px]; DV pixels are not square."""
    cx: float = 349.6
    """Principal point [px]."""
    cy: float = 285.0
    """Principal point [px]."""
    distortion: Vector8 = (-0.18, 0.05, 0.0, 0.0, -0.005, 0.0, 0.0, 0.0)
    """k1, k2, p1, p2, k3, k4, k5, k6 in OpenCV's order and meaning [ours]."""
    source: SourceConfig = field(default_factory=SourceConfig)
    camera_from_guide: PoseConfig = field(default_factory=PoseConfig)


class VisionConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Eq. (12) and Fig. 5."""

    weights: Vector3 = (-0.525, 1.0, -0.648)
    """Fisher's discriminant: weight of blue, green, red [ours, fitted on labelled pixels]."""
    threshold: float = 5.0
    """A pixel whose weighted sum exceeds this is marker [grey levels]."""
    alternatives: tuple[tuple[Vector3, float], ...] = (
        ((-0.8, 1.0, -0.8), 5.0),
        ((-0.45, 1.0, -0.55), 8.0),
        ((-0.525, 1.0, -0.648), 40.0),
    )
    """Weights and threshold to try in turn where the first give no clear verdict: for a white
    balance so green that grey looks green, for light so bright that green looks white, and for
    bands that run into each other in a blurred picture [ours]."""
    smoothing: Annotated[int, Meta(ge=0, le=8)] = 1
    """Passes of the 3x3 binomial low-pass over the projected channel; 0 is none [ours]."""
    minimum_area: Annotated[int, Meta(ge=1)] = 15
    """Regions below this are dropped [px]."""
    model_deviation: Positive = 2.5
    """Of a band from where the instrument's model has it: standard deviation [px] [ours]."""
    least_inside: Fraction = 0.5
    """A band of which less is in the image is refused [share of its area] [ours]."""
    least_coverage: Fraction = 0.4
    """A band of which less has the markers' colour is refused [share of its area] [ours]."""
    largest_spill: Fraction = 0.25
    """A band around which more has the markers' colour is refused [share of a ring, relative to its
    coverage] [ours]."""
    least_edges: Fraction = 0.4
    """A band at less of whose outline the colour ends is refused [share of it] [ours]."""
    least_edges_on_average: Fraction = 0.65
    """The same for the mean of both bands [ours]."""
    least_edges_alone: Fraction = 0.85
    """The same for a band that is found alone, and 4/3 of its coverage [ours]."""
    largest_surprise: Positive = 18.5
    """Largest squared Mahalanobis distance of the bands from where they are expected; chi squared
    with 4 degrees of freedom exceeds it once in a thousand [ours]."""


class ControlConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Rates and memory of the loop."""

    period: Positive = 0.005
    """Control tick [s] [ours; the article says hundreds of Hz]."""
    history: Positive = 2.0
    """How long commands are remembered, so that a frame finds the one in force when it was
    captured [s]; at most 1024 ticks. An older frame is refused."""


class RecordingConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The log of a run. All [ours]."""

    image_format: ImageFormat = "png"
    """``png`` is lossless, so that a replay gives the same outputs; ``jpeg`` is a fifth of it and
    moves the features by up to 0.3 px, so that no replay is identical (decision 0020)."""
    jpeg_quality: Annotated[int, Meta(ge=1, le=100)] = 95
    """With ``jpeg``."""
    flush_period: Annotated[float, Meta(gt=0, le=0.2)] = 0.1
    """What is older is in the file if the process is killed [s]."""
    sync_period: Positive = 5.0
    """What is older is on the disk if the power fails [s]."""
    queue_events: Annotated[int, Meta(ge=1)] = 20_000
    """Ticks and image updates that may wait for a slow disk; more are dropped, and it is said."""
    queue_images: Annotated[int, Meta(ge=1)] = 50
    """Images that may wait for encoder and disk; likewise."""
    close_timeout: Positive = 10.0
    """How long the end of a run may wait for a slow disk [s]."""


class Sine(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Reference of one DOF: centre + amplitude sin(2 pi t / period)."""

    centre: float
    """Where the DOF is held while the others move [m or rad]."""
    amplitude: Positive
    """[m or rad]."""
    period: Positive = 10.0
    """[s]."""


class ExperimentConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Section 5: a sine on each DOF in succession.

    Amplitudes are [ours]: the article's are in its figure only.
    """

    periods: Annotated[int, Meta(ge=3)] = 5
    """Per DOF [paper]."""
    insertion: Sine = field(default_factory=lambda: Sine(centre=25e-3, amplitude=15e-3))
    rotation: Sine = field(default_factory=lambda: Sine(centre=0.0, amplitude=2.0))
    bending: Sine = field(default_factory=lambda: Sine(centre=0.9, amplitude=0.9))

    def __getitem__(self, dof: Dof) -> Sine:
        """The reference of one DOF."""
        sine: Sine = getattr(self, dof.label)
        return sine


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


class AxisConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One motor and its drive. What has no default is a fact of the rig that nobody can guess."""

    node: Annotated[int, Meta(ge=1, le=127)]
    """CANopen node id; with EtherCAT, the position on the line, from 1."""
    counts_per_unit: Positive
    """Encoder counts per m or rad of the instrument's degree of freedom, gears included."""
    sign: Literal[-1, 1]
    """1 where counts grow with the degree of freedom, else -1."""
    travel: tuple[float, float]
    """Least and largest position [m or rad]; set in the drive and checked before every command."""
    speed_limit: Positive
    """[m/s or rad/s]; likewise."""
    following_error: Positive
    """How far the motor may be from what was commanded within the last 0.1 s [m or rad]."""
    home: float = 0.0
    """Where the degree of freedom is when the drive reads 0 counts [m or rad]."""
    eds: str | None = None
    """The drive's EDS file, seen from the TOML file's folder; without it, the objects of CiA 402
    that are used."""


class DrivesConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Motors on a bus. Only a rig of hardware, or the bench that stands for one, has them.

    The times are [ours].
    """

    insertion: AxisConfig
    rotation: AxisConfig
    bending: AxisConfig
    protocol: Literal["canopen", "ethercat"] = "canopen"
    interface: str = "socketcan"
    """Any of python-can's, as it names them; not those that hear their own frames."""
    channel: str = "can0"
    """What the interface calls the bus; with EtherCAT, the network adapter."""
    bitrate: Annotated[int, Meta(ge=10_000, le=1_000_000)] = 1_000_000
    """[bit/s]; SocketCAN takes the operating system's."""
    options: dict[str, str | int | float | bool] = field(default_factory=dict)
    """What else the interface wants to know."""
    cycle: Positive = 0.01
    """From one set-point to the next [s], whole milliseconds."""
    reply_timeout: Positive = 0.006
    """How long a cycle waits for the drives' answers [s]; what comes later counts as late."""
    lead_points: Annotated[int, Meta(ge=0, le=16)] = 2
    """Set-points ahead in the input buffer, interpolated position mode only; each is a cycle's
    delay, and covers a cycle's unpunctuality."""
    master_node: Annotated[int, Meta(ge=1, le=127)] = 127
    """Node id of our own heartbeat."""
    heartbeat_period: Positive = 0.02
    """[s], ours and the drives', whole milliseconds."""
    heartbeat_timeout: Positive = 0.08
    """Silence after which a drive quick-stops, and after which we stop all drives [s], whole
    milliseconds."""
    state_timeout: Positive = 1.0
    """For each state of the drive to be reached [s]."""
    request_timeout: Positive = 0.3
    """For each answer to a request [s]."""
    command_timeout: Positive = 0.5
    """How long the motors are held where they are while the loop gives no command; then quick
    stop [s]."""
    start_speed: Fraction = 0.1
    """Share of `speed_limit` at which the motors go to where a run starts."""
    after_quick_stop: Literal["hold", "release"] = "hold"
    """Whether the motor is held where it stopped, or let go."""
    waive: tuple[Literal["6007", "605A", "607D"], ...] = ()
    """Protections the drives do not have: what a lost connection does, what a quick stop does,
    limits of travel. Each named here is one you go without."""

    def __getitem__(self, dof: Dof) -> AxisConfig:
        """The motor of one DOF."""
        axis: AxisConfig = getattr(self, dof.label)
        return axis


class Config(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Everything a run depends on. The defaults are the article's experiment."""

    profile: Profile = "paper"
    """How slack is compensated and learnt, and the state estimated: ``paper`` as in the article,
    ``best`` as in `AdaptiveConfig` and `StateEstimationConfig`."""
    adaptive: AdaptiveConfig = field(default_factory=AdaptiveConfig)
    state_estimation: StateEstimationConfig = field(default_factory=StateEstimationConfig)
    insertion: DofConfig = field(
        default_factory=lambda: DofConfig(
            update_distance=0.4e-3, observable_deviation=2e-3, start_deviation=5e-3
        )
    )
    rotation: DofConfig = field(
        default_factory=lambda: DofConfig(
            update_distance=0.04, observable_deviation=0.1, start_deviation=0.6
        )
    )
    bending: DofConfig = field(
        default_factory=lambda: DofConfig(
            update_distance=0.02, observable_deviation=0.1, start_deviation=0.5
        )
    )
    instrument: InstrumentConfig = field(default_factory=InstrumentConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)
    vision: VisionConfig = field(default_factory=VisionConfig)
    control: ControlConfig = field(default_factory=ControlConfig)
    recording: RecordingConfig = field(default_factory=RecordingConfig)
    experiment: ExperimentConfig = field(default_factory=ExperimentConfig)
    twin: TwinConfig = field(default_factory=TwinConfig)
    drives: DrivesConfig | None = None
    """Motors of a rig; nothing about them can be guessed, so there is no default."""

    def __getitem__(self, dof: Dof) -> DofConfig:
        """The settings of one DOF."""
        settings: DofConfig = getattr(self, dof.label)
        return settings

    def replace(self, **changes: Any) -> Config:
        """A copy with changes by dotted path, checked: ``replace(**{"twin.seed": 3})``.

        Raises:
            ConfigError: As `load_config`.
        """
        document = to_document(self)
        for path, value in changes.items():
            *sections, key = path.split(".")
            place = document
            for section in sections:
                place = place.setdefault(section, {})
            place[key] = value
        return from_document(document)


def load_config(path: str | PathLike[str] | None = None, profile: Profile | None = None) -> Config:
    """Read a TOML configuration; keys that are not named keep their defaults.

    Args:
        path: TOML file; without it, the article's experiment.
        profile: ``"paper"`` or ``"best"``; without it, what the file says, else ``"paper"``.

    Raises:
        MissingPathError: The file is not there.
        ConfigError: It is not TOML, or a key is unknown, of the wrong type or out of range; the
            error names the key, what came and what may come.
    """
    changes = {} if profile is None else {"profile": profile}
    if path is None:
        return from_document(changes)
    file = Path(path)
    try:
        document = tomllib.loads(file.read_text(encoding="utf-8"))
    except (FileNotFoundError, IsADirectoryError):
        raise MissingPathError("config", str(file), "a TOML file") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError("config", str(file), f"TOML ({error})") from None
    _place_files(document, file.absolute().parent)
    return from_document(document | changes)


def from_document(document: dict[str, Any]) -> Config:
    """Check a nested dictionary and make it a `Config`; what it does not name keeps its default.

    Raises:
        ConfigError: As `load_config`.
    """
    document = _merged(to_document(Config()), document)
    try:
        config = msgspec.convert(document, Config)
    except msgspec.ValidationError as error:
        raise _named(error, document) from None
    _check_finite(msgspec.to_builtins(config), "")
    _check_relations(config)
    return config


def to_document(config: Config) -> dict[str, Any]:
    """The nested dictionary of a configuration, without the keys that are None."""
    document: dict[str, Any] = _without_none(msgspec.to_builtins(config))
    return document


def dump_config(config: Config) -> str:
    """The configuration as TOML, every key written out; `load_config` reads it back equal."""
    return tomli_w.dumps(to_document(config))


def _place_files(document: dict[str, Any], folder: Path) -> None:
    """Files that a TOML file names are beside it, wherever the program runs."""
    drives = document.get("drives")
    for axis in drives.values() if isinstance(drives, dict) else ():
        if isinstance(axis, dict) and isinstance(axis.get("eds"), str):
            axis["eds"] = str(folder / axis["eds"])


def _merged(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, value in changes.items():
        old = merged.get(key)
        if isinstance(old, dict) and isinstance(value, dict):
            merged[key] = _merged(old, value)
        else:
            merged[key] = value
    return merged


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return value


def _named(error: msgspec.ValidationError, document: dict[str, Any]) -> ConfigError:
    """The library says what and where; the value that came is looked up in the document."""
    message = str(error)
    expected, _, path = message.partition(" - at `$")
    path = path.rstrip("`").lstrip(".")
    unknown = re.search(r"unknown field `([^`]*)`", expected)
    missing = re.search(r"missing required field `([^`]*)`", expected)
    for named in (unknown, missing):
        if named:
            path = f"{path}.{named[1]}".lstrip(".")
    value: Any = document
    for key in re.findall(r"[^.\[\]]+", path):
        try:
            value = value[int(key)] if isinstance(value, list | tuple) else value[key]
        except (KeyError, TypeError, IndexError, ValueError):
            value = None
            break
    if unknown:
        allowed = "no such key; `tautscope config` prints those there are"
    elif missing:
        allowed = "a value: it has no default"
    else:
        allowed = expected.removeprefix("Expected ").split(", got")[0].replace("`", "")
    return ConfigError(path or "config", value, allowed)


def _check_finite(value: Any, path: str) -> None:
    if isinstance(value, dict):
        for key, item in value.items():
            _check_finite(item, f"{path}.{key}".lstrip("."))
    elif isinstance(value, list | tuple):
        for index, item in enumerate(value):
            _check_finite(item, f"{path}[{index}]")
    elif isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(path, value, "a finite number")


def _check_relations(config: Config) -> None:
    """What no single field can check."""
    for dof in Dof:
        settings = config[dof]
        if settings.free_gain > settings.gain_limit:
            raise ConfigError(
                f"{dof.label}.free_gain",
                settings.free_gain,
                f"at most {dof.label}.gain_limit = {settings.gain_limit}",
            )
        if settings.delta_minus > settings.delta_plus:
            raise ConfigError(
                f"{dof.label}.delta_minus",
                settings.delta_minus,
                f"at most {dof.label}.delta_plus = {settings.delta_plus}",
            )
    adaptive = config.adaptive
    if adaptive.cautious_gain > adaptive.contact_gain:
        raise ConfigError(
            "adaptive.cautious_gain",
            adaptive.cautious_gain,
            f"at most adaptive.contact_gain = {adaptive.contact_gain}",
        )
    instrument = config.instrument
    half = instrument.band_length / 2
    if not half <= instrument.marker_a <= instrument.marker_b - 2 * half:
        raise ConfigError(
            "instrument.marker_a",
            instrument.marker_a,
            "a band on the tip, wholly proximal of marker_b's band",
        )
    if instrument.marker_b + half > instrument.tip_length:
        raise ConfigError(
            "instrument.marker_b", instrument.marker_b, "a band that ends before the tip does"
        )
    twin = config.twin
    if twin.latency_jitter > twin.latency:
        raise ConfigError(
            "twin.latency_jitter", twin.latency_jitter, f"at most twin.latency = {twin.latency}"
        )
    for index, name in enumerate(twin.disturb):
        if name not in DISTURBANCES:
            raise ConfigError(f"twin.disturb[{index}]", name, "one of " + ", ".join(DISTURBANCES))
    ticks = config.control.history / config.control.period
    if not 1 <= ticks <= 1024:
        raise ConfigError(
            "control.history",
            config.control.history,
            f"1 to 1024 ticks of control.period = {config.control.period}",
        )
    if config.drives is not None:
        _check_drives(config.drives)


def _check_drives(drives: DrivesConfig) -> None:
    taken = {drives.master_node: "master_node"}
    for dof in Dof:
        axis, path = drives[dof], f"drives.{dof.label}"
        if axis.node in taken:
            raise ConfigError(f"{path}.node", axis.node, f"not that of drives.{taken[axis.node]}")
        taken[axis.node] = dof.label
        lower, upper = axis.travel
        if lower >= upper:
            raise ConfigError(f"{path}.travel", axis.travel, "the lesser end, then the larger")
        if max(abs(end - axis.home) for end in axis.travel) * axis.counts_per_unit >= 2**31:
            raise ConfigError(
                f"{path}.counts_per_unit",
                axis.counts_per_unit,
                f"less than 2^31 counts over the travel {axis.travel}",
            )
        step = axis.speed_limit * drives.cycle * axis.counts_per_unit
        if step < 1:
            raise ConfigError(
                f"{path}.counts_per_unit",
                axis.counts_per_unit,
                "a count or more per cycle at the speed limit: counts per m or rad, not mm or deg",
            )
    for name, most in (
        ("cycle", 0.255),
        ("heartbeat_period", 65.535),
        ("heartbeat_timeout", 65.535),
    ):
        value = getattr(drives, name)
        if not (0.001 <= value <= most and math.isclose(value * 1e3, round(value * 1e3))):
            raise ConfigError(f"drives.{name}", value, f"whole milliseconds, 0.001 to {most}")
    if drives.reply_timeout >= drives.cycle:
        raise ConfigError(
            "drives.reply_timeout", drives.reply_timeout, f"less than drives.cycle = {drives.cycle}"
        )
    least = 2 * max(drives.heartbeat_period, drives.cycle)
    if drives.heartbeat_timeout < least:
        raise ConfigError(
            "drives.heartbeat_timeout",
            drives.heartbeat_timeout,
            f"at least {least}: two heartbeats and two cycles",
        )
