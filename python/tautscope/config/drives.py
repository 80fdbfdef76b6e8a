"""Motors on a bus."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from tautscope.config.fields import Fraction, Positive
from tautscope.dof import Dof


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
    """How far the motor may be from all that was commanded within the last `lag` [m or rad]."""
    following_window: Positive
    """Likewise for longer than `following_timeout` [m or rad]; at most `following_error`."""
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
    lag: Positive = 0.02
    """How long the motors may take to follow [s]: filter and servo of the drives, and a set-point
    that came late for its cycle."""
    following_timeout: Positive = 0.05
    """How long a motor may be beyond its `following_window` [s], whole milliseconds."""
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
