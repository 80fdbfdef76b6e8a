"""Three CiA 402 drives that follow streamed positions, safe on every way out.

    with open_drives(config.drives) as drives:
        position = drives.start()
        while running:
            applied = drives.exchange(command)  # once per drives.cycle, from one thread

What it asks of a drive: mode 8 (cyclic synchronous position), else 7 (interpolated position). What
the drive does when it loses us, and on quick stop, its limits of travel and speed: set, and read
back. Anything unexpected is a `DriveError`: the motors have then been brought to quick stop.
"""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import BusError, DriveError, SignalError, StateError
from tautscope.hardware.cia402 import Scale
from tautscope.hardware.commissioning import commission
from tautscope.hardware.cycles import Cycles
from tautscope.hardware.link import Link
from tautscope.hardware.signals import signals_deferred
from tautscope.hardware.watch import Traffic, Watch


def open_drives(config: DrivesConfig) -> Drives:
    """Open the bus, find the drives, set them and read back; no motor moves or is enabled.

    Raises:
        ConfigError: An EDS file is missing, unreadable or of another drive.
        DriveError: As `Drives`.
    """
    return Drives(config, open_link(config))


def open_link(config: DrivesConfig) -> Link:
    """Open the bus and find the drives; they are told nothing.

    Raises:
        ConfigError: An EDS file is missing, unreadable or of another drive.
        BusError: The bus cannot be opened.
        DriveError: A drive does not answer, or there is another master.
    """
    if config.protocol == "ethercat":
        from tautscope.hardware.ethercat_drives import EthercatLink  # noqa: PLC0415

        return EthercatLink(config)
    try:
        from tautscope.hardware.canopen_drives import CanopenLink  # noqa: PLC0415
    except ImportError as error:
        raise BusError("CAN bus", str(error), "pip install 'tautscope[hardware]'") from None
    return CanopenLink(config)


class Drives:
    """Three drives, one per DOF; one thread may use them.

    Args:
        config: What they are.
        link: The bus they are on; it is closed with them.

    Raises:
        ModeRefusedError: A drive has neither mode 8 nor 7, or did not take it.
        SettingRefusedError: A setting was refused, or reads back differently.
        DriveError: A drive does not answer, or is not one.
    """

    def __init__(self, config: DrivesConfig, link: Link) -> None:
        self.config = config
        self._link = link
        self._scales = [Scale(config[dof], dof.label) for dof in Dof]
        self._running = False
        self._closed = False
        self._previous: NDArray[np.float64] = np.zeros(3)
        try:
            self.commissioned = tuple(commission(link, config, dof) for dof in Dof)
            modes = {dof: self.commissioned[dof].mode for dof in Dof}
            self._watch = Watch(config, [link.name(dof) for dof in Dof], modes)
            self._cycles = Cycles(config, link, modes, self._watch)
            link.prepare(modes)
        except BaseException:
            link.close()
            raise

    @property
    def cycle(self) -> float:
        """Time from one `exchange` to the next [s]."""
        return self.config.cycle

    @property
    def running(self) -> bool:
        """Whether the motors follow commands."""
        return self._running

    @property
    def traffic(self) -> Traffic:
        """How punctual the bus was since `start`."""
        return self._watch.traffic

    @property
    def last_command(self) -> NDArray[np.float64]:
        """(3,) [m, rad, rad] what was last sent, or where the motors were at the start."""
        return self._previous.copy()

    def start(self, *, reset_faults: bool = False) -> NDArray[np.float64]:
        """Enable the motors where they are; `exchange` must follow within `heartbeat_timeout`.

        Args:
            reset_faults: Acknowledge faults the drives hold from before. Find their cause first.

        Returns:
            (3,) where the motors are [m, rad, rad]; the first command starts from there.

        Raises:
            StateError: A drive holds a fault, or did not reach a state in `state_timeout`.
            FollowingError: A motor is outside its travel.
            DriveError: As `exchange`.
        """
        if self._running or self._closed:
            raise StateError("drives", "started while running or closed", "Open them anew")
        try:
            said = self._cycles.enable(reset_faults=reset_faults)
        except BaseException as error:
            self._stop_because(error)
            raise
        self._previous = self._watch.begin(said)
        self._running = True
        return self._previous.copy()

    def exchange(self, command: ArrayLike) -> NDArray[np.float64]:
        """Send one set-point to every drive and read where the motors are.

        Call it every `cycle` seconds: it does not pace itself, it waits for the answers only.

        Args:
            command: (3,) [m, rad, rad].

        Returns:
            (3,) [m, rad, rad] what the drives report.

        Raises:
            SignalError: The command is not finite, leaves the travel or is too fast.
            StateError: A drive left operation enabled, its mode, or ignores set-points.
            FollowingError: A motor is not where it was told to be.
            SilentDriveError: A drive has not answered for `heartbeat_timeout`.
            HeartbeatError: A drive's heartbeat stayed away.
            EmergencyError: A drive sent an emergency.
            SecondMasterError: Somebody else commands the drives.
            BusError: The bus is gone.

        All motors have been brought to quick stop when any of these is raised.
        """
        if not self._running:
            raise StateError("drives", "a command before start or after stop", "Call start first")
        try:
            wanted = _three(command)
            targets = [
                scale.checked(wanted[dof], self._previous[dof], self.cycle)
                for dof, scale in enumerate(self._scales)
            ]
            applied = self._watch.check(wanted, self._cycles.send(targets))
        except BaseException as error:
            self._stop_because(error)
            raise
        self._previous = wanted
        return applied

    def stop(self) -> None:
        """Bring all motors to quick stop and see that they are; the bus stays open.

        Does nothing when they are. Signals wait until it is done.

        Raises:
            StateError: A drive does not confirm; use the emergency stop.
        """
        with signals_deferred():
            unconfirmed = self._quick_stop()
        if unconfirmed:
            raise _unconfirmed(unconfirmed)

    def disable(self) -> None:
        """`stop`, then take the power from the motors: nothing holds them any more.

        Raises:
            StateError: A drive does not confirm; use the emergency stop.
        """
        with signals_deferred():
            self._running = False
            unconfirmed = self._cycles.disable()
        if unconfirmed:
            raise _unconfirmed(unconfirmed, "disabling")

    def close(self) -> None:
        """`stop`, then release the bus; may be called twice.

        Raises:
            StateError: As `stop`.
        """
        with signals_deferred():
            if self._closed:
                return
            self._closed = True
            try:
                unconfirmed = self._quick_stop()
            finally:
                self._link.close()
        if unconfirmed:
            raise _unconfirmed(unconfirmed)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        try:
            self.close()
        except DriveError as failed:
            if error is None:
                raise
            error.add_note(str(failed))

    def _stop_because(self, error: BaseException) -> None:
        with signals_deferred():
            unconfirmed = self._quick_stop()
        if unconfirmed:
            error.add_note(str(_unconfirmed(unconfirmed)))
        if own_pause := self._watch.own_pause:
            error.add_note(own_pause)

    def _quick_stop(self) -> list[str]:
        """Quick-stop all drives; the names of those that do not confirm it."""
        self._running = False
        return self._cycles.quick_stop()


def _three(command: ArrayLike) -> NDArray[np.float64]:
    try:
        wanted = np.array(command, dtype=np.float64)
    except (TypeError, ValueError):
        raise SignalError("command", command, "three finite numbers [m, rad, rad]") from None
    if wanted.shape != (3,):
        raise SignalError("command", command, "three finite numbers [m, rad, rad]")
    return wanted


def _unconfirmed(names: list[str], what: str = "quick stop") -> StateError:
    return StateError(
        "; ".join(names),
        f"{what} is not confirmed",
        "Use the emergency stop: the motor may be moving",
    )
