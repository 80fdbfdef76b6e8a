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
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import (
    BusError,
    DriveError,
    FollowingError,
    SignalError,
    SilentDriveError,
    StateError,
)
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode, Scale, State
from tautscope.hardware.commissioning import LAG, commission
from tautscope.hardware.link import Feedback, Link
from tautscope.hardware.signals import signals_deferred


@dataclass(slots=True)
class Traffic:
    """How punctual the bus was.

    Attributes:
        cycles: Set-points sent.
        late: Answers that did not come within their cycle, per DOF.
        longest_pause: Longest time between two cycles [s].
    """

    cycles: int = 0
    late: list[int] = field(default_factory=lambda: [0, 0, 0])
    longest_pause: float = 0.0


def open_drives(config: DrivesConfig) -> Drives:
    """Open the bus, find the drives, set them and read back; no motor moves or is enabled.

    Raises:
        ConfigError: An EDS file is missing or unreadable.
        DriveError: As `Drives`.
    """
    link: Link
    if config.protocol == "ethercat":
        from tautscope.hardware.ethercat_drives import EthercatLink  # noqa: PLC0415

        link = EthercatLink(config)
    else:
        try:
            from tautscope.hardware.canopen_drives import CanopenLink  # noqa: PLC0415
        except ImportError as error:
            raise BusError("CAN bus", str(error), "pip install 'tautscope[hardware]'") from None
        link = CanopenLink(config)
    return Drives(config, link)


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
        self.traffic = Traffic()
        self._link = link
        self._scales = [Scale(config[dof], dof.label) for dof in Dof]
        self._running = False
        self._closed = False
        self._words = [cia402.DISABLE_VOLTAGE] * 3
        self._targets = [0, 0, 0]
        self._feedback: list[Feedback] = []
        self._previous: NDArray[np.float64] = np.zeros(3)
        self._recent: deque[NDArray[np.float64]] = deque(
            maxlen=max(1, round(LAG / config.cycle)) + config.lead_points
        )
        self._last_cycle = time.monotonic()
        try:
            self.commissioned = tuple(commission(link, config, dof) for dof in Dof)
            self._modes = {dof: self.commissioned[dof].mode for dof in Dof}
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
            self._check_inside()
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
        self._previous = self._positions()
        self._recent.extend([self._previous] * (self._recent.maxlen or 1))
        self.traffic = Traffic()
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
            self._recent.append(wanted)
            before = self._feedback
            self._cycle()
            self._check(before)
        except BaseException as error:
            self._stop_because(error)
            raise
        self._previous = wanted
        return self._positions()

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
        if self._closed:
            return
        self._closed = True
        with signals_deferred():
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
        now = time.monotonic()
        if self.traffic.cycles:
            self.traffic.longest_pause = max(self.traffic.longest_pause, now - self._last_cycle)
        self._last_cycle = now
        self._feedback = self._link.cycle(self._words, self._targets)
        self.traffic.cycles += 1
        for dof, said in enumerate(self._feedback):
            self.traffic.late[dof] += said.age > 0

    def _paced_cycle(self) -> None:
        began = time.monotonic()
        self._cycle()
        time.sleep(max(0.0, self.cycle - (time.monotonic() - began)))

    def _positions(self) -> NDArray[np.float64]:
        return np.array(
            [
                scale.to_position(said.position)
                for scale, said in zip(self._scales, self._feedback, strict=True)
            ]
        )

    def _check(self, before: list[Feedback]) -> None:
        """What the drives said in this cycle, against what they were told."""
        positions = self._positions()
        commands = np.stack(self._recent)
        for dof in Dof:
            said, name = self._feedback[dof], self._link.name(dof)
            if said.silence > self.config.heartbeat_timeout:
                raise SilentDriveError(
                    name,
                    f"no answer to {said.age} set-points, {said.silence * 1e3:.0f} ms",
                    "Check its supply and the bus, and what else loads this computer",
                )
            state = cia402.state_of(said.statusword)
            if state is not State.OPERATION_ENABLED:
                raise self._left(dof, state, said)
            if said.mode != self._modes[dof]:
                raise StateError(
                    name,
                    f"it changed from mode {self._modes[dof].value} to {said.mode}",
                    "Let nobody else command it",
                )
            if not said.statusword & cia402.FOLLOWS:
                raise StateError(
                    name,
                    f"it ignores set-points (statusword 0x{said.statusword:04X}, bit 12)",
                    "See its limits and inputs; it may be halted",
                )
            if said.age == 0:
                self._check_position(dof, before, positions[dof], commands[:, dof])

    def _check_position(
        self,
        dof: Dof,
        before: list[Feedback],
        position: float,
        commands: NDArray[np.float64],
    ) -> None:
        axis, said, name = self.config[dof], self._feedback[dof], self._link.name(dof)
        error = max(float(commands.min()) - position, position - float(commands.max()))
        flagged = (
            said.statusword & cia402.FOLLOWING_ERROR
            and self._modes[dof] is Mode.CYCLIC_SYNCHRONOUS_POSITION
        )
        if error > axis.following_error or flagged:
            raise FollowingError(
                name,
                f"it is at {position:.6g} and was told to be within {commands.min():.6g} and "
                f"{commands.max():.6g}" + (" (the drive says so itself)" if flagged else ""),
                "See whether something blocks the motor, then drives."
                f"{dof.label}.counts_per_unit and following_error",
            )
        jump = abs(position - self._scales[dof].to_position(before[dof].position))
        elapsed = (before[dof].age + 2) * self.cycle
        if jump > 2 * axis.speed_limit * elapsed + axis.following_error:
            raise FollowingError(
                name, f"its position jumped by {jump:.6g} in a cycle", "Check the encoder's cable"
            )

    def _check_inside(self) -> None:
        for dof, scale in zip(Dof, self._scales, strict=True):
            position = scale.to_position(self._targets[dof])
            lower, upper = self.config[dof].travel
            slack = self.config[dof].following_error
            if not lower - slack <= position <= upper + slack:
                raise FollowingError(
                    self._link.name(dof),
                    f"it stands at {position:.6g}, outside its travel {lower} to {upper}",
                    f"Move it there by hand, or check drives.{dof.label}.home, sign and "
                    "counts_per_unit",
                )

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
                elif time.monotonic() - since[dof] <= self.config.state_timeout:
                    continue
                elif said.age:
                    raise SilentDriveError(
                        self._link.name(dof),
                        f"no answer to {said.age} set-points",
                        "Check its supply, and whether it takes synchronous PDOs",
                    )
                else:
                    raise self._left(dof, cia402.state_of(said.statusword), said, stuck=True)
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
            raise self._left(dof, state, said)
        word = cia402.towards_enabled(state)
        if word is not None:
            self._words[dof] = word
        if state is not State.OPERATION_ENABLED:
            self._targets[dof] = said.position  # what it stands at is what it shall hold
        return state is State.OPERATION_ENABLED

    def _follow(self, dof: Dof, state: State | None, said: Feedback) -> bool:
        if state is not State.OPERATION_ENABLED:
            raise self._left(dof, state, said)
        if self._modes[dof] is Mode.INTERPOLATED_POSITION:
            self._words[dof] = cia402.INTERPOLATE
        return bool(said.statusword & cia402.FOLLOWS)

    def _left(
        self, dof: Dof, state: State | None, said: Feedback, *, stuck: bool = False
    ) -> StateError:
        shown = "a state CiA 402 does not have" if state is None else state.value
        fault = state in (State.FAULT, State.FAULT_REACTION)
        paused = time.monotonic() - self._last_cycle
        if fault:
            remedy = "Find the fault's cause in its manual (0x603F), then start with reset_faults"
        elif self.traffic.longest_pause > self.config.heartbeat_timeout:
            remedy = (
                f"This computer paused for {self.traffic.longest_pause * 1e3:.0f} ms: unload it"
            )
        else:
            remedy = "Check its supply, its enable input and its limits"
        what = f"it stays in {shown}" if stuck else f"it is in {shown}, not operation enabled"
        silent = f", silent for {said.silence + paused:.1f} s" if said.age else ""
        return StateError(
            self._link.name(dof), f"{what} (statusword 0x{said.statusword:04X}{silent})", remedy
        )

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
        pending = list(Dof)
        deadline = time.monotonic() + self.config.state_timeout
        while pending and time.monotonic() < deadline:
            try:
                said = self._link.quick_stop(self._targets)
            except DriveError:
                break  # the bus itself is gone
            pending = [
                dof
                for dof in Dof
                if said[dof].age or cia402.state_of(said[dof].statusword) not in cia402.AT_REST
            ]
            if pending:
                time.sleep(self.cycle / 4)
        self._feedback = []
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
