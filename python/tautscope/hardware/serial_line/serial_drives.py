"""Motors behind a microcontroller: a `tautscope.hardware.drive_group.DriveGroup`.

Each cycle is one request with the set-points of all axes, which is answered at once by all
positions and the state. The microcontroller stops the motors by itself if no set-points come for
`heartbeat_timeout` (docs/serial.md).
"""

import struct
import time
from typing import Any

from tautscope.config import DrivesConfig
from tautscope.dof import Motor
from tautscope.errors import (
    DriveError,
    EmergencyError,
    ModeRefusedError,
    SettingRefusedError,
    SilentDriveError,
    StateError,
)
from tautscope.hardware.drive_group import (
    RESET,
    CommissionedDrive,
    DriveGroup,
    DriveStatus,
    Feedback,
    paused,
)
from tautscope.hardware.scale import Scale
from tautscope.hardware.serial_line import frames
from tautscope.hardware.serial_line.frames import FAULTS, Hello, Limits, Refusal, Request, State
from tautscope.hardware.serial_line.line import SerialLine

_START = 4.0
"""How long a microcontroller may take to start after its port was opened [s]."""
_REPEAT = 0.1
"""After which time without an answer a request is repeated [s]."""
_FAULT = f"Find the cause, then {RESET}"


class SerialDrives(DriveGroup):
    """Motors behind a microcontroller on an open port, which is closed with them.

    Raises:
        SilentDriveError: No microcontroller answers.
        ModeRefusedError: It speaks another version of the protocol.
    """

    def __init__(self, config: DrivesConfig, port: Any) -> None:
        self._line = SerialLine(port, config.channel)
        names = [f"{dof.label}, axis {config[dof].node}" for dof in config.all_motors]
        super().__init__(config, names, self._line.close)
        self._at = [config[dof].node - 1 for dof in config.all_motors]
        """Index of each motor among the axes of the microcontroller."""
        self._targets: list[int] = []
        try:
            self._axes = self._greet().axes
        except BaseException:
            self.close()
            raise

    def status(self, dof: Motor) -> DriveStatus:
        """Read state, fault and position.

        Raises:
            SettingRefusedError: There is no such axis.
        """
        limits, at = self._limits(dof), self._at[dof]
        status = self._ask(Request.READ)
        fault, state = status.faults[at], _state(status.state)
        found = f"{state}; {_fault_name(fault) if fault else 'no fault'}; {limits.lower} to "
        found += f"{limits.upper} counts; up to {limits.speed} counts/s"
        problem = _FAULT if fault or status.state == State.FAULT else ""
        if status.state == State.ENABLED:
            problem = "Its motors are enabled: end the program that uses it"
        data = {"state": state, "fault": fault, "limits": limits._asdict()}
        return DriveStatus(status.positions[at], found, problem, data=data)

    def commission(self, dof: Motor) -> CommissionedDrive:
        """Compare travel and speed limit with the limits of the microcontroller.

        Raises:
            SettingRefusedError: There is no such axis, or a limit is beyond those.
        """
        limits = self._limits(dof)
        scale = Scale(self._config[dof], dof)
        lower, upper = scale.travel_counts()
        if lower < limits.lower or upper > limits.upper:
            raise SettingRefusedError(
                self.names[dof],
                f"{dof.key}.travel is {lower} to {upper} counts, and the microcontroller "
                f"takes {limits.lower} to {limits.upper}",
                "Correct travel, home or counts_per_unit, or the limits in its program",
            )
        if (speed := scale.speed_counts()) > limits.speed:
            raise SettingRefusedError(
                self.names[dof],
                f"{dof.key}.speed_limit is {speed} counts/s, and the microcontroller "
                f"reaches {limits.speed}",
                f"Lower {dof.key}.speed_limit, or let a step be a larger motion",
            )
        return CommissionedDrive(self.names[dof], 0, 0, 0, limits._asdict())

    def read_positions(self) -> list[int]:
        """Read the positions."""
        return self._positions(self._ask(Request.READ))

    def probe(self) -> list[Feedback]:
        """Read all axes once."""
        self._receive(self._line.send(Request.READ))
        return self._feedback

    def enable(self, *, reset_faults: bool) -> list[Feedback]:
        """See `DriveGroup.enable`."""
        status = self._ask(Request.READ)
        if reset_faults:
            status = self._ask(Request.DISABLE)
        self._check_faults(status, StateError)
        if status.state == State.FAULT:
            raise StateError(self._line.name, "a fault has stopped it", _FAULT)
        self._was_enabled = self._is_moving = True
        if status.state == State.ENABLED:
            # Left by a killed host: it may still move, with that host's watchdog time.
            status = self._ask(Request.STOP)
        watchdog = struct.pack("<H", round(1e3 * self._config.heartbeat_timeout))
        status = self._ask(Request.ENABLE, watchdog)
        if status.state != State.ENABLED:
            self._check_faults(status, StateError)
            what = f"it stays {_state(status.state)}{_why(status.refusal)}"
            raise StateError(self._line.name, what, "Check its program; power-cycle it")
        self._targets = list(status.positions)
        targets = self._positions(status)
        self.start(targets)
        return self.exchange(targets)

    def exchange(self, targets: list[int]) -> list[Feedback]:
        """Send the set-points, read the positions, check state and faults."""
        self._check_pause(self._line.name)
        for at, target in zip(self._at, targets, strict=True):
            self._targets[at] = target
        self._receive(self._line.send(Request.SETPOINTS, frames.setpoints(self._targets)))
        return self._feedback

    def _stop(self) -> list[str]:
        """Stop all motors, and hold or release them, as `after_quick_stop`."""
        is_held = self._config.after_quick_stop == "hold"
        return self._command(Request.STOP if is_held else Request.DISABLE)

    def _switch_off(self) -> list[str]:
        return self._command(Request.DISABLE)

    def _greet(self) -> Hello:
        """Repeat hello until it is answered: opening the port may restart an Arduino."""
        deadline = time.monotonic() + _START
        while time.monotonic() < deadline:
            number = self._line.send(Request.HELLO)
            for message in self._line.receive(number, _REPEAT):
                hello = frames.read_hello(message)
                if hello is None:
                    continue
                if hello.version != frames.VERSION:
                    raise ModeRefusedError(
                        self._line.name,
                        f"it speaks version {hello.version} of the protocol, and this program "
                        f"version {frames.VERSION}",
                        "Load a program with the header of this version (arduino)",
                    )
                return hello
        raise SilentDriveError(
            self._line.name,
            f"no answer for {_START:g} s",
            "Check drives.channel, drives.bitrate, its supply, and that a program which speaks "
            "docs/serial.md is loaded",
        )

    def _limits(self, dof: Motor) -> Limits:
        if self._at[dof] >= len(self._axes):
            raise SettingRefusedError(
                self.names[dof],
                f"the microcontroller has {len(self._axes)} axes",
                f"Correct {dof.key}.node",
            )
        return self._axes[self._at[dof]]

    def _positions(self, status: frames.Status) -> list[int]:
        return [status.positions[at] for at in self._at]

    def _ask(self, kind: Request, body: bytes = b"", timeout: float | None = None) -> frames.Status:
        deadline = time.monotonic() + (timeout or self._config.request_timeout)
        while (now := time.monotonic()) < deadline:
            number = self._line.send(kind, body)
            for message in self._line.receive(number, min(_REPEAT, deadline - now)):
                status = frames.read_status(message, len(self._axes))
                if status is not None and status.number == number:
                    return status
        raise SilentDriveError(self._line.name, "no answer", "Check its supply and cable")

    def _command(self, kind: Request) -> list[str]:
        """Carry out a request that stops the motors; names of those that may be moving."""
        try:
            if self._ask(kind, timeout=self._config.state_timeout).state != State.ENABLED:
                return []
        except DriveError:
            pass  # silent, or the port is lost
        return list(self.names)

    def _receive(self, number: int) -> None:
        """Wait for an answer; late ones to earlier requests count too."""
        messages = self._line.receive(number, self._config.reply_timeout)
        answers = [frames.read_status(message, len(self._axes)) for message in messages]
        now = time.monotonic()
        for one in self._feedback:
            one.age, one.silence = one.age + 1, now - one.answered_at
        for status in answers:
            if status is None:
                continue
            for position, one in zip(self._positions(status), self._feedback, strict=True):
                one.position, one.silence, one.answered_at = position, 0.0, now
                one.answers += 1
                one.age = one.age if status.number != number else 0
            if self._is_moving:
                self._check(status)

    def _check(self, status: frames.Status) -> None:
        self._check_faults(status, EmergencyError)
        if status.state == State.SILENCE:
            raise paused(self._line.name, self._config, time.monotonic() - self._sent_at)
        if status.state != State.ENABLED:
            raise StateError(
                self._line.name,
                f"it is {_state(status.state)}",
                "If it restarted, it has forgotten its positions: check its supply, and "
                "drives.*.home",
            )
        if status.refusal:
            what = f"it does not carry out set-points{_why(status.refusal)}"
            raise StateError(self._line.name, what, "Check its program")

    def _check_faults(self, status: frames.Status, error: type[DriveError]) -> None:
        for at, fault in enumerate(status.faults):
            if fault:
                name = self.names[self._at.index(at)] if at in self._at else f"axis {at + 1}"
                raise error(name, f"it reports a fault: {_fault_name(fault)}", _FAULT)


def _fault_name(number: int) -> str:
    return f"{FAULTS.get(number, 'of its own')} ({number})"


def _why(refusal: int) -> str:
    """Why a request was refused; empty if it was not."""
    if not refusal:
        return ""
    name = Refusal(refusal).name.lower() if refusal in list(Refusal) else "of its own"
    return f", and refuses with reason {refusal}, {name} (docs/serial.md)"


def _state(number: int) -> str:
    return State(number).name.lower() if number in list(State) else f"in state {number}"
