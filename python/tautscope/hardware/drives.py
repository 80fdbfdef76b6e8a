"""Drives that follow set-points and quick-stop whenever their context is left.

    with open_drives(config.drives) as drives:
        position = drives.start()
        for applied in drives.follow(commands):  # one command per drives.cycle
            ...

Their reaction to a lost connection, position and velocity limits are set and read back. `Drives`
knows no protocol: CiA 402 drives, servos and microcontrollers are behind `DriveGroup`. Every
failure raises a `DriveError` after the motors have been quick-stopped.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import DrivesConfig
from tautscope.config.microcontroller import PROTOCOL
from tautscope.config.servos import PORTS
from tautscope.errors import (
    EMERGENCY_STOP,
    STOPPED,
    DriveError,
    FollowingError,
    SignalError,
    StateError,
    described,
)
from tautscope.extras import require_extras
from tautscope.hardware.cia402_drives import Cia402Drives
from tautscope.hardware.drive_group import DriveGroup
from tautscope.hardware.drive_monitor import BusStatistics, DriveMonitor
from tautscope.hardware.rig_lock import RigLock
from tautscope.hardware.scale import Scale
from tautscope.hardware.signals import defer_signals


def open_drives(config: DrivesConfig) -> Drives:
    """Open the bus and configure the drives; no motor is enabled.

    Raises:
        ConfigError: An EDS file is missing, unreadable or describes another drive.
        SecondMasterError: Another program on this computer has opened them.
        DriveError: As `Drives`.
    """
    lock = RigLock(config)
    try:
        return Drives(config, open_group(config), lock)
    except BaseException:
        lock.release()
        raise


def open_group(config: DrivesConfig) -> DriveGroup:
    """Open the bus and identify the drives; no setting is changed.

    Raises:
        ConfigError: An EDS file is missing, unreadable or describes another drive.
        MissingExtraError: The library of the bus is not installed.
        BusError: The bus cannot be opened.
        DriveError: A drive does not answer, or there is another master.
    """
    if config.protocol == "ethercat":
        from tautscope.hardware.ethercat_fieldbus import EthercatFieldbus  # noqa: PLC0415

        return Cia402Drives(config, EthercatFieldbus(config))
    if config.protocol in PORTS:
        from tautscope.hardware.servos.servo_drives import ServoDrives  # noqa: PLC0415

        return ServoDrives(config)
    if config.protocol == PROTOCOL:
        from tautscope.hardware.serial_line.line import open_port  # noqa: PLC0415
        from tautscope.hardware.serial_line.serial_drives import SerialDrives  # noqa: PLC0415

        return SerialDrives(config, open_port(config))
    require_extras("CANopen", ["hardware"])
    from tautscope.hardware.canopen_fieldbus import CanopenFieldbus  # noqa: PLC0415

    return Cia402Drives(config, CanopenFieldbus(config))


class Drives:
    """The drives of a rig, one per motor; for use by one thread.

    Args:
        config: Bus, drives, limits and timeouts.
        group: The drives on an open bus, which is closed with them.
        lock: Released with the drives.

    Attributes:
        cycle: Time from one `exchange` to the next [s].

    Raises:
        ModeRefusedError: A drive has neither mode 8 nor 7, or did not enter it.
        SettingRefusedError: A setting was refused, or reads back differently.
        DriveError: A drive does not answer, or is no CiA 402 drive.
    """

    def __init__(
        self, config: DrivesConfig, group: DriveGroup, lock: RigLock | None = None
    ) -> None:
        self.config, self.cycle = config, config.cycle
        self._lock = lock
        self._group = group
        self._scales = [Scale(config[dof], dof) for dof in config.all_motors]
        self._is_running = False
        self._is_closed = False
        self._previous: NDArray[np.float64] = np.zeros(len(config.all_motors))
        try:
            self.commissioned = tuple(group.commission(dof) for dof in config.all_motors)
            self._monitor = DriveMonitor(config, group.names, group.pending)
            group.configure()
        except BaseException:
            group.close()
            raise

    @property
    def is_running(self) -> bool:
        """Whether the motors are enabled and follow commands."""
        return self._is_running

    @property
    def statistics(self) -> BusStatistics:
        """Timing of the bus since `start`."""
        return self._monitor.statistics

    @property
    def last_command(self) -> NDArray[np.float64]:
        """(n,) [m or rad] the command sent last, or the position at the start."""
        return self._previous.copy()

    def start(self, *, reset_faults: bool = False) -> NDArray[np.float64]:
        """Enable the motors; `exchange` must be called within `heartbeat_timeout`.

        Args:
            reset_faults: Reset faults of the drives. Find their cause first.

        Returns:
            (n,) position actual values [m or rad]; the first command starts from there.

        Raises:
            StateError: A drive is in fault, or did not reach a state within `state_timeout`.
            FollowingError: A motor is outside its travel.
            DriveError: As `exchange`.
        """
        if self._is_running or self._is_closed:
            raise StateError(
                "drives", "start() was called while running or closed", "Open them again"
            )
        self._monitor.reset_statistics()
        try:
            positions = self._group.read_positions()
            self._monitor.check_start_positions(positions)
            self._group.start(positions)
            feedback = self._group.enable(reset_faults=reset_faults)
        except BaseException as error:
            self._stop_after(error)
            raise
        self._previous = self._monitor.reset(feedback)
        self._is_running = True
        return self._previous.copy()

    def exchange(self, command: ArrayLike) -> NDArray[np.float64]:
        """Send one set-point to each drive and read the position actual values.

        Call it every `cycle` seconds, as `follow` does: it waits for the answers only, and called
        more often it moves the motors as much faster.

        Args:
            command: (n,) [m or rad].

        Returns:
            (n,) position actual values [m or rad].

        Raises:
            SignalError: The command is not finite, leaves the travel or is too fast.
            StateError: A drive left operation enabled or its mode, or ignores set-points.
            FollowingError: The following error is too large.
            SilentDriveError: A drive has not answered in time for `heartbeat_timeout`.
            HeartbeatError: A drive's heartbeat is missing.
            EmergencyError: A drive sent an emergency object.
            SecondMasterError: Another master commands the drives.
            BusError: The bus is lost.

        All motors are quick-stopped before any of these is raised.
        """
        if not self._is_running:
            raise StateError(
                "drives", "a command before start() or after stop()", "Call start() first"
            )
        try:
            setpoint = as_vector(command, len(self._scales))
            targets = [
                scale.checked_counts(setpoint[dof], self._previous[dof], self.cycle)
                for dof, scale in enumerate(self._scales)
            ]
            self._monitor.begin_cycle()
            applied = self._monitor.check(setpoint, self._group.exchange(targets))
        except BaseException as error:
            self._stop_after(error)
            raise
        self._previous = setpoint
        return applied

    def follow(self, commands: Iterable[ArrayLike]) -> Iterator[NDArray[np.float64]]:
        """Exchange a command in each cycle; the position actual values (n,) [m or rad].

        Raises:
            DriveError: As `exchange`.
        """
        due = time.monotonic()
        for command in commands:
            yield self.exchange(command)
            # After a pause of this process no set-points in a burst.
            due = max(due + self.cycle, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))

    def stop(self) -> None:
        """Quick-stop all motors and wait for confirmation; the bus stays open.

        Does nothing if they are stopped; a stop that was not confirmed is repeated. Signals are
        deferred until it returns.

        Raises:
            StateError: A drive does not confirm; use the emergency stop.
        """
        with defer_signals():
            _require_confirmed(self._quick_stop(again=True))

    def disable(self) -> None:
        """`stop`, wait for rest, and disable voltage: nothing holds the motors any more.

        Raises:
            StateError: A drive does not confirm; use the emergency stop.
        """
        with defer_signals():
            self._is_running = False
            _require_confirmed(self._group.disable(), "disabling")

    def close(self) -> None:
        """`stop`, then release the bus; a second call does nothing.

        Raises:
            StateError: As `stop`.
        """
        with defer_signals():
            if self._is_closed:
                return
            self._is_closed = True
            with ExitStack() as resources:
                if self._lock is not None:
                    resources.callback(self._lock.release)
                resources.callback(self._group.close)
                _require_confirmed(self._quick_stop())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        try:
            self.close()
        except DriveError as failed:
            if error is None:
                raise
            error.add_note(described(failed))

    def _stop_after(self, error: BaseException) -> None:
        self._monitor.note_pause()
        with defer_signals():
            try:
                _require_confirmed(self._quick_stop())
            except StateError as failed:
                error.add_note(str(failed))
            if isinstance(error, FollowingError) and (note := self._group.remark()):
                error.add_note(note)
        if note := self._monitor.pause_note:
            error.add_note(note)

    def _quick_stop(self, *, again: bool = False) -> list[str]:
        """Quick-stop all drives; names of those that do not confirm it."""
        self._is_running = False
        return self._group.quick_stop(again=again)


def as_vector(command: ArrayLike, count: int) -> NDArray[np.float64]:
    """A command as an array (n,) [m or rad] of its own.

    Raises:
        SignalError: It is not `count` numbers.
    """
    try:
        vector = np.array(command, dtype=np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    if vector.shape != (count,):
        raise SignalError("command", command, f"{count} finite numbers [m or rad]")
    return vector


def _require_confirmed(unconfirmed: list[str], what: str = "quick stop") -> None:
    if unconfirmed:
        error = StateError(
            "; ".join(unconfirmed),
            f"{what} is not confirmed",
            f"{EMERGENCY_STOP}: the motor may be moving",
        )
        error.exit_status = STOPPED
        raise error
