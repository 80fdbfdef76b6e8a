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

import time
from collections.abc import Callable
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import (
    BusError,
    DriveError,
    SignalError,
    StateError,
)
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode, Scale, State
from tautscope.hardware.commissioning import commission
from tautscope.hardware.link import Feedback, Link
from tautscope.hardware.signals import signals_deferred
from tautscope.hardware.watch import Traffic, Watch

CONFIRMATIONS = 2
"""Answers in a row that show a motor at rest; one may have been under way before the stop."""


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
        self._words = [cia402.DISABLE_VOLTAGE] * 3
        self._targets = [0, 0, 0]
        self._feedback: list[Feedback] = []
        self._previous: NDArray[np.float64] = np.zeros(3)
        self._last_cycle = time.monotonic()
        try:
            self.commissioned = tuple(commission(link, config, dof) for dof in Dof)
            self._modes = {dof: self.commissioned[dof].mode for dof in Dof}
            self._watch = Watch(config, [link.name(dof) for dof in Dof], self._modes)
            link.prepare(self._modes)
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
            self._targets = [self._link.read(dof, objects.POSITION) for dof in Dof]
            self._watch.check_start(self._targets)
            self._link.operational()
            if reset_faults:
                self._walk(self._reset)
            self._words = [cia402.DISABLE_VOLTAGE] * 3
            self._walk(self._enable)
            if Mode.INTERPOLATED_POSITION in self._modes.values():
                for _ in range(self.config.lead_points):
                    self._paced_cycle()
            self._walk(self._follow)
        except BaseException as error:
            self._stop_because(error)
            raise
        self._previous = self._watch.begin(self._feedback)
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
            self._targets = [
                scale.checked(wanted[dof], self._previous[dof], self.cycle)
                for dof, scale in enumerate(self._scales)
            ]
            self._cycle()
            applied = self._watch.check(wanted, self._feedback)
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

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        try:
            self.close()
        except DriveError as failed:
            if error is None:
                raise
            error.add_note(str(failed))

    # The cycle

    def _cycle(self) -> None:
        now, traffic = time.monotonic(), self.traffic
        if traffic.cycles:
            traffic.longest_pause = max(traffic.longest_pause, now - self._last_cycle)
        self._last_cycle = now
        traffic.cycles += 1
        self._feedback = self._link.cycle(self._words, self._targets)

    def _paced_cycle(self) -> None:
        began = time.monotonic()
        self._cycle()
        time.sleep(max(0.0, self.cycle - (time.monotonic() - began)))

    # Enabling

    def _walk(self, step: Callable[[Dof, State | None, Feedback], bool]) -> None:
        """Cycle until `step` is content with every drive; each state has its own time."""
        seen: list[int | None] = [None] * 3
        since = [time.monotonic()] * 3
        while True:
            self._paced_cycle()
            done = True
            for dof in Dof:
                said = self._feedback[dof]
                if said.age and not said.statusword:
                    content = False  # it has not spoken yet
                else:
                    content = step(dof, cia402.state_of(said.statusword), said)
                done = done and content
                if content or said.statusword != seen[dof]:
                    seen[dof], since[dof] = said.statusword, time.monotonic()
                elif time.monotonic() - since[dof] > self.config.state_timeout:
                    raise self._watch.stuck(dof, said)
            if done:
                return

    def _reset(self, dof: Dof, state: State | None, said: Feedback) -> bool:
        if state in (State.FAULT, State.FAULT_REACTION):
            # Only the change of bit 7 from 0 to 1 counts.
            self._words[dof] ^= cia402.FAULT_RESET
            return False
        self._words[dof] = cia402.DISABLE_VOLTAGE
        return True

    def _enable(self, dof: Dof, state: State | None, said: Feedback) -> bool:
        if state is State.FAULT:
            raise self._watch.wrong_state(dof, said)
        word = cia402.towards_enabled(state)
        if word is not None:
            self._words[dof] = word
        if state is not State.OPERATION_ENABLED:
            self._targets[dof] = said.position  # what it stands at is what it shall hold
        return state is State.OPERATION_ENABLED

    def _follow(self, dof: Dof, state: State | None, said: Feedback) -> bool:
        if state is not State.OPERATION_ENABLED:
            raise self._watch.wrong_state(dof, said)
        if self._modes[dof] is Mode.INTERPOLATED_POSITION:
            self._words[dof] = cia402.INTERPOLATE
        return bool(said.statusword & cia402.FOLLOWS)

    # Stopping

    def _stop_because(self, error: BaseException) -> None:
        with signals_deferred():
            unconfirmed = self._quick_stop()
        if unconfirmed:
            error.add_note(str(_unconfirmed(unconfirmed)))

    def _quick_stop(self) -> list[str]:
        """Quick-stop all drives; the names of those that do not confirm it."""
        self._running = False
        if not self._feedback:
            return []  # at rest: never cycled, or stopped before
        confirmed = [0, 0, 0]
        deadline = time.monotonic() + self.config.state_timeout
        while min(confirmed) < CONFIRMATIONS and time.monotonic() < deadline:
            try:
                said = self._link.quick_stop(self._targets)
            except DriveError:
                break  # the bus itself is gone
            for dof, one in enumerate(said):
                rests = not one.age and cia402.state_of(one.statusword) in cia402.AT_REST
                confirmed[dof] = confirmed[dof] + 1 if rests else 0
            if not all(confirmed):
                time.sleep(self.cycle / 4)
        self._feedback = []
        pending = [dof for dof in Dof if confirmed[dof] < CONFIRMATIONS]
        if pending:
            self._link.abandon(pending)
        return [self._link.name(dof) for dof in pending]


def _three(command: ArrayLike) -> NDArray[np.float64]:
    try:
        wanted = np.array(command, dtype=np.float64)
    except (TypeError, ValueError):
        raise SignalError("command", command, "three finite numbers [m, rad, rad]") from None
    if wanted.shape != (3,):
        raise SignalError("command", command, "three finite numbers [m, rad, rad]")
    return wanted


def _unconfirmed(names: list[str]) -> StateError:
    return StateError(
        "; ".join(names),
        "quick stop is not confirmed",
        "Use the emergency stop: the motor may be moving",
    )
