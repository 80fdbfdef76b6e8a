"""The drives of a rig."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta, Struct, field

from tautscope.config.fields import Fraction, Positive
from tautscope.dof import Dof


class AxisConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One motor and its drive. Keys without a default are facts of the rig."""

    node: Annotated[int, Meta(ge=1, le=127)]
    """CANopen node id; with EtherCAT the position on the bus, from 1."""
    counts_per_unit: Positive
    """Encoder counts per m or rad of the degree of freedom, gears included."""
    sign: Literal[-1, 1]
    """1 if counts increase with the degree of freedom, else -1."""
    travel: tuple[float, float]
    """Lower and upper position limit [m or rad]; set in the drive, checked before every command."""
    speed_limit: Positive
    """Speed limit [m/s or rad/s]; set in the drive, checked before every command."""
    following_error: Positive
    """Largest distance of the motor from all commands within the last `lag` [m or rad]."""
    following_window: Positive
    """Largest such distance for longer than `following_timeout` [m or rad]; at most
    `following_error`."""
    home: float = 0.0
    """Position of the degree of freedom at 0 counts [m or rad]."""
    eds: str | None = None
    """EDS file of the drive, relative to the TOML file; by default, the objects of CiA 402 that are
    used."""


class DrivesConfig(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The drives of a hardware rig, or of the bench that simulates one.

    The times are [ours].
    """

    insertion: AxisConfig
    rotation: AxisConfig
    bending: AxisConfig
    protocol: Literal["canopen", "ethercat"] = "canopen"
    interface: str = "socketcan"
    """An interface of python-can that does not receive its own frames."""
    channel: str = "can0"
    """Name of the bus at the interface; with EtherCAT the network adapter."""
    bitrate: Annotated[int, Meta(ge=10_000, le=1_000_000)] = 1_000_000
    """[bit/s]; SocketCAN uses that of the operating system."""
    options: dict[str, str | int | float | bool] = field(default_factory=dict)
    """Further options of the interface."""
    cycle: Positive = 0.01
    """Time from one set-point to the next [s], whole milliseconds."""
    reply_timeout: Positive = 0.006
    """Time limit for the drives' answers in a cycle [s]; later answers count as late."""
    lead_points: Annotated[int, Meta(ge=0, le=16)] = 2
    """Set-points ahead in the input buffer, in interpolated position mode; each delays by one cycle
    and tolerates one cycle of jitter."""
    master_node: Annotated[int, Meta(ge=1, le=127)] = 127
    """Node id of the master's heartbeat."""
    heartbeat_period: Positive = 0.02
    """Heartbeat period of master and drives [s], whole milliseconds."""
    heartbeat_timeout: Positive = 0.08
    """Time without a heartbeat after which a drive, or the master, stops the motors [s], whole
    milliseconds."""
    state_timeout: Positive = 1.0
    """Time limit for each change of a drive's state [s]."""
    request_timeout: Positive = 0.3
    """Time limit for the answer to a request [s]."""
    lag: Positive = 0.02
    """Largest lag of the motors [s]: filter and servo of the drives, and one late set-point."""
    following_timeout: Positive = 0.05
    """Time that a motor may be outside its `following_window` [s], whole milliseconds."""
    command_timeout: Positive = 0.5
    """Time without a command, in which the motors hold their position, until a quick stop [s]."""
    start_speed: Fraction = 0.1
    """Share of `speed_limit` for the motion to the start of a run."""
    after_quick_stop: Literal["hold", "release"] = "hold"
    """Whether a motor is held or released after a quick stop."""
    waive: tuple[Literal["6007", "605A", "607D"], ...] = ()
    """Objects of missing protections that the user accepts: reaction to a lost connection (6007),
    quick stop (605A), position limits (607D)."""

    def __getitem__(self, dof: Dof) -> AxisConfig:
        """The drive of one DOF."""
        axis: AxisConfig = getattr(self, dof.label)
        return axis
