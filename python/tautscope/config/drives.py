"""Configuration of the drives or servos on a bus."""

import math
from typing import Annotated, Literal

from msgspec import Meta, field

from tautscope.config.fields import LIMITS, Fraction, Positive
from tautscope.config.microcontroller import MOST_AXES, PROTOCOL, SERIAL_PORTS
from tautscope.config.section import Section, require, require_at_most, require_defaults
from tautscope.config.servos import PORTS, models_of
from tautscope.dof import Dof, Motor, NamedMotor

Preset = Literal["copley", "elmo_gold", "elmo_whistle", "epos4"]
"""Makers' drives, see `tautscope.config.drive_defaults`."""
Waiver = Literal[
    "1016", "1017", "6007", "6041.12", "6041.13", "605A", "6061", "607D", "607F", "60C2", "6502"
]
"""What `DrivesConfig.waive` may name: an object, or a bit of the statusword (0x6041)."""
WAIVERS: dict[Waiver, str] = {
    "1016": "another protection stops the motors when this computer fails",
    "1017": "its answers to set-points are enough to supervise it",
    "6007": "another protection stops the motors when this computer fails",
    "6041.12": "its manual says that bit 12 of the statusword stays 0 in this mode",
    "6041.13": "its manual gives bit 13 of the statusword another meaning than a following error",
    "605A": "its quick stop is the wanted one without this setting",
    "6061": "its manual says that it shows the mode only while it is enabled",
    "607D": "another protection limits its travel",
    "607F": "it counts speeds in another unit than counts/s, or has no such limit",
    "60C2": "the time between its set-points is drives.cycle without this setting",
    "6502": "its manual says that it has mode 8 or 7",
}
"""When each waiver is right; it completes "if ..." in messages."""

FASTEST = 1000.0
"""Most widths of `AxisConfig.travel` per s: more is a speed in mm/s or deg/s."""
Timeout = Annotated[float, Meta(gt=0, le=60)]
"""Limited like all that limits depend on: milliseconds given for seconds would switch them off."""
_OF_CIA_402 = (
    "interface",
    "options",
    "lead_points",
    "master_node",
    "heartbeat_period",
    "preset",
    "interpolation_time",
    "waive",
)
"""Keys of [drives] that only CiA 402 drives use."""
_OF_SERVOS = ("model", "homing_offset", "stops", "torque_limit")
"""Keys of a motor that only servos use."""


def waiver_hint(waiver: Waiver) -> str:
    """When to add a waiver, for messages."""
    return f"If {WAIVERS[waiver]}, add {waiver} to drives.waive"


class AxisConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One motor and its drive.

    Values without a default depend on the rig. A servo needs only `node`, `model`, `travel`, and
    for insertion `counts_per_unit`; another motor `node`, `counts_per_unit`, `travel` and
    `speed_limit`.
    """

    node: Annotated[int, Meta(ge=1, le=127)]
    """CANopen node id or id of a servo; position on the EtherCAT line or axis of a microcontroller,
    from 1."""
    counts_per_unit: Positive
    """Encoder counts per m or rad of the DOF, including gears. A servo has 4096 per turn: 651.9 per
    rad, its default."""
    sign: Literal[-1, 1]
    """1, the default, if the counts increase with the DOF, else -1."""
    travel: tuple[float, float]
    """Smallest and largest position [m or rad]; set in the drive, checked for every command."""
    speed_limit: Positive
    """Largest speed [m/s or rad/s]; set and checked alike."""
    following_error: Positive
    """Largest distance of the motor from all commands of the last `lag` [m or rad]; by default 1 %
    of the width of `travel`, of a servo 64 counts; at most half of that width."""
    following_window: Positive
    """Largest distance that may last longer than `following_timeout` [m or rad]; by default half of
    `following_error`."""
    home: float = 0.0
    """Position of the DOF at 0 counts [m or rad]."""
    eds: str | None = None
    """The drive's EDS file, relative to the TOML file; without it, the types of CiA 402."""
    model: str | None = None
    """Model of a servo, which the connected one must be."""
    homing_offset: Annotated[int, Meta(ge=-2047, le=2047)] = 0
    """What a servo itself adds to its position, set in it [counts]."""
    stops: tuple[float, float] | None = None
    """Mechanical stops of a servo around `travel`, by `tautscope calibrate stops` [m or rad]."""
    torque_limit: Annotated[float, Meta(gt=0, le=1)] = 1.0
    """Share of its largest voltage (Dynamixel, goal PWM) or torque (Feetech) that a servo uses."""


class MotorConfig(AxisConfig, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A motor of a robot with ``[[dof]]``; the unit of its values is `unit`."""

    unit: Annotated[str, Meta(min_length=1, max_length=10)] = "rad"
    """Unit of its positions: that of its degree of freedom, or of ``actuators.units``."""


class DrivesConfig(Section, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Drives or servos on a bus; only a physical rig and the bench have this section.

    The default times are [ours].
    """

    insertion: AxisConfig | None = None
    rotation: AxisConfig | None = None
    bending: AxisConfig | None = None
    motors: Annotated[dict[str, MotorConfig], Meta(max_length=8)] = field(default_factory=dict)
    """In place of insertion, rotation and bending, the motors of a robot with ``[[dof]]``, by its
    names or those of ``[actuators]`` in their order: the keys below, and ``unit`` of the DOF or of
    ``actuators.units``."""
    protocol: Literal["canopen", "ethercat", "dynamixel", "feetech", "serial"] = "canopen"
    """CiA 402 drives on CANopen or EtherCAT, Dynamixel X servos, Feetech STS servos, or motors
    behind a microcontroller on a serial line."""
    interface: str = "socketcan"
    """A python-can interface that does not receive its own frames."""
    channel: str = "can0"
    """Its channel; network adapter of EtherCAT; else the serial port, by default /dev/ttyUSB0
    (Dynamixel) or /dev/ttyACM0."""
    bitrate: Annotated[int, Meta(ge=9_600, le=4_000_000)] = 1_000_000
    """[bit/s]; by default 250000 of a microcontroller. SocketCAN has that of the operating
    system."""
    options: dict[str, str | int | float | bool] = field(default_factory=dict)
    """Further options of the interface."""
    cycle: Positive = 0.01
    """Time from one set-point to the next [s], whole milliseconds."""
    reply_timeout: Positive = 0.006
    """How long a cycle waits for the drives' answers; later ones are counted, and their positions
    not checked [s]."""
    lead_points: Annotated[int, Meta(ge=0, le=16)] = 2
    """Set-points in the drive's input buffer in mode 7; each adds a delay of one cycle and
    tolerates jitter of one."""
    master_node: Annotated[int, Meta(ge=1, le=127)] = 127
    """Node id of the master's heartbeat."""
    heartbeat_period: Positive = 0.02
    """Period of all heartbeats [s], whole milliseconds."""
    heartbeat_timeout: Positive = 0.08
    """Time without a heartbeat after which drives quick-stop [s], whole milliseconds, at most 5, of
    Dynamixel 2.54; of servos, without an answer or a set-point; watchdog time of a microcontroller,
    and of Dynamixel, rounded up to 20 ms. All are stopped too if answers of a motor are late for so
    long."""
    state_timeout: Timeout = 1.0
    """Timeout of each state transition [s]."""
    request_timeout: Timeout = 0.3
    """Timeout of each SDO response, or answer of a servo to a setting [s]."""
    lag: Annotated[float, Meta(gt=0, le=1)] = 0.02
    """Largest delay of the motors [s]: filters and servo loops, late set-points; by default 0.06 of
    servos and microcontrollers."""
    following_timeout: Positive = 0.05
    """How long the following error may exceed `following_window` [s], whole milliseconds, at most
    1.5."""
    command_timeout: Timeout = 0.5
    """Time without a command, in which the motors are held, until their quick stop [s]."""
    start_speed: Fraction = 0.1
    """Fraction of `speed_limit` for the move to the start of a run."""
    after_quick_stop: Literal["hold", "release"] = "hold"
    """What happens to the motors after a quick stop."""
    preset: Preset | None = None
    """Settings of a maker's drives, which this section's keys replace; waivers add up."""
    interpolation_time: bool = False
    """Whether the cycle is set (0x60C2) in mode 8 too."""
    waive: tuple[Waiver, ...] = ()
    """What the drives lack and the run does without: docs/hardware.md, presets and waivers."""

    @property
    def all_motors(self) -> tuple[Motor, ...]:
        """The motors in the order of every array."""
        named = enumerate(self.motors.items())
        return tuple(NamedMotor(at, name, each.unit) for at, (name, each) in named) or tuple(Dof)

    def __getitem__(self, motor: Motor) -> AxisConfig:
        """Settings of one motor."""
        own = self.motors or {dof.label: getattr(self, dof.label) for dof in Dof}
        return own[motor.label]

    def _check(self) -> None:
        """Also the ranges that CANopen can express."""
        given = [dof.label for dof in Dof if getattr(self, dof.label) is not None]
        if self.motors:
            require(not given, "motors", list(self.motors), f"either motors or {', '.join(given)}")
        for dof in () if self.motors else Dof:
            allowed = "a motor, or motors of [[dof]] in [drives.motors]"
            require(dof.label in given, dof.label, None, allowed)
        taken = {self.master_node: "master_node"}
        for motor in self.all_motors:
            axis, path = self[motor], motor.key.removeprefix("drives.")
            owner = taken.get(axis.node)
            require(owner is None, f"{path}.node", axis.node, f"not that of {owner}")
            taken[axis.node] = motor.label
            self._check_motor(axis, path)
        if self.protocol in SERIAL_PORTS:
            require_defaults(self, "", _OF_CIA_402, "only CiA 402 drives use it")
        else:
            require(self.bitrate <= 1_000_000, "bitrate", self.bitrate, "at most 1000000 on CAN")
        for name, most in (
            ("cycle", 0.255),
            ("heartbeat_period", 2.5),
            ("heartbeat_timeout", 2.54 if self.protocol == "dynamixel" else 5.0),
            ("following_timeout", 1.5),
        ):
            value = getattr(self, name)
            is_valid = 0.001 <= value <= most and math.isclose(value * 1e3, round(value * 1e3))
            require(is_valid, name, value, f"whole milliseconds, 0.001 to {most}")
        reply, cycle = self.reply_timeout, self.cycle
        require(reply < cycle, "reply_timeout", reply, f"less than cycle = {cycle}")
        least, timeout = 2 * max(self.heartbeat_period, cycle), self.heartbeat_timeout
        allowed = f"at least {least}: two heartbeats and two cycles"
        require(timeout >= least, "heartbeat_timeout", timeout, allowed)

    def _check_motor(self, axis: AxisConfig, path: str) -> None:
        def check(is_valid: bool, key: str, allowed: str) -> None:
            require(is_valid, f"{path}.{key}", getattr(axis, key), allowed)

        travel, counts, protocol = axis.travel, axis.counts_per_unit, self.protocol
        width, farthest = travel[1] - travel[0], max(abs(end - axis.home) for end in travel)
        check(width > 0, "travel", LIMITS)
        fastest = f"at most {FASTEST * width:.3g}: {FASTEST:g} times the width of travel per s"
        check(axis.speed_limit <= FASTEST * width, "speed_limit", fastest)
        few = f"less than 2^31 counts from home = {axis.home} to both ends of travel = {travel}"
        check(farthest * counts < 2**31, "counts_per_unit", few)
        half = f"at most half of the width of travel = {travel}"
        check(2.0 * axis.following_error <= width, "following_error", half)
        require_at_most(path, axis, "following_window", "following_error")
        if protocol in PORTS:
            models = models_of(protocol)
            check(axis.model in models, "model", "one of " + ", ".join(models))
            lower, upper = axis.stops or (-math.inf, math.inf)
            is_inside = lower <= travel[0] and travel[1] <= upper
            check(is_inside, "travel", f"within stops = {axis.stops}")
        else:
            require_defaults(axis, path, _OF_SERVOS, "only servos use it")
        if protocol in SERIAL_PORTS:
            require_defaults(axis, path, ("eds",), "only CiA 402 drives use it")
        if protocol == PROTOCOL:
            axes = f"an axis of the microcontroller, 1 to {MOST_AXES}"
            check(axis.node <= MOST_AXES, "node", axes)
        many = "at least one count per cycle at the speed limit; per m or rad, not mm or deg"
        check(axis.speed_limit * self.cycle * counts >= 1, "counts_per_unit", many)
