"""Three servos on a serial line: a `tautscope.hardware.drive_group.DriveGroup`.

Each cycle is one sync write of the set-points and one sync read of position, voltage and
temperature. A servo in position mode holds its last set-point. Of the two families only Dynamixel
stops by itself when packets are missing (bus watchdog, `heartbeat_timeout`); docs/hardware.md
says what moves after the end of the host.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from tautscope.config import DrivesConfig
from tautscope.config.servos import COUNTS_PER_TURN, MODELS
from tautscope.dof import Dof
from tautscope.errors import (
    DriveError,
    EmergencyError,
    ModeRefusedError,
    SettingRefusedError,
    SilentDriveError,
    StateError,
)
from tautscope.hardware.drive_group import CommissionedDrive, DriveStatus
from tautscope.hardware.scale import Scale
from tautscope.hardware.servos.families import FAMILIES, Register, Setting
from tautscope.hardware.servos.line import NoAnswerError, ServoLine

T = TypeVar("T")
_LOG = logging.getLogger(__name__)
_WATCHDOG_UNIT = 0.02
"""Unit of the bus watchdog [s]."""
_FAULT_REMEDY = (
    "Find the cause (load, supply, temperature; docs/hardware.md), then power-cycle it or start "
    "with reset_faults"
)


@dataclass(slots=True)
class ServoFeedback:
    """The newest answer of a servo; see `tautscope.hardware.drive_group.Feedback`."""

    position: int = 0
    age: int = 0
    answers: int = 0
    silence: float = 0.0
    reports_following_error: bool = False
    answered_at: float = 0.0


class ServoDrives:
    """Three servos on a serial line.

    Args:
        config: Port, ids, models, limits and timeouts.

    Raises:
        MissingExtraError: The extra ``servo`` is not installed.
        BusError: The port cannot be opened.
    """

    pending = 1

    def __init__(self, config: DrivesConfig) -> None:
        self._config = config
        self._family = family = FAMILIES[config.protocol]
        self._ids = [config[dof].node for dof in Dof]
        self._line = ServoLine(config, family)
        self._feedback = [ServoFeedback() for _ in Dof]
        self._goals = [0, 0, 0]
        self._sent_at = 0.0
        self._has_lost_answers = self._is_moving = self._was_enabled = False
        self._block = family.position.address
        self._block_size = family.temperature.address + family.temperature.size - self._block

    def name(self, dof: Dof) -> str:
        """See `DriveGroup.name`."""
        return f"{dof.label}, servo {self._ids[dof]}"

    def serial_number(self, dof: Dof) -> str:
        """Servos have none."""
        return ""

    def status(self, dof: Dof) -> DriveStatus:
        """Read model, torque, faults, voltage, temperature and position."""
        family, wanted = self._family, self._config[dof].model or ""
        number = self._read(dof, family.model)
        position, torque = self._read(dof, family.position), self._read(dof, family.torque)
        faults = self._read(dof, family.faults)
        voltage = self._read(dof, family.voltage) / 10
        temperature = self._read(dof, family.temperature)
        names = family.faults_in(faults)
        problem = ""
        if number != MODELS[wanted].number:
            problem = self._wrong_model(dof, number)[1]
        elif faults:
            problem = _FAULT_REMEDY
        state = f"fault: {', '.join(names) or hex(faults)}" if faults else "no fault"
        return DriveStatus(
            position,
            f"{_model_name(number)}; torque {'on' if torque else 'off'}; {state}; "
            f"{voltage:.1f} V; {temperature} °C",
            problem,
            data={
                "model": number,
                "torque": bool(torque),
                "faults": names,
                "voltage": voltage,
                "temperature": temperature,
            },
        )

    def commission(self, dof: Dof) -> CommissionedDrive:
        """Set the mode for several turns, speed and torque limit, and read them back.

        Raises:
            ModeRefusedError: It is another model.
            StateError: A stored setting differs while the torque is on.
            SettingRefusedError: A setting was refused, or reads back differently.
        """
        axis, name = self._config[dof], self.name(dof)
        number = self._read(dof, self._family.model)
        if number != MODELS[axis.model or ""].number:
            raise ModeRefusedError(name, *self._wrong_model(dof, number))
        scale = Scale(axis, dof.label)
        furthest = max(map(abs, scale.travel_counts()))
        if furthest > self._family.largest:
            raise SettingRefusedError(
                name,
                f"drives.{dof.label}.travel is up to {furthest} counts from 0",
                f"It counts to {self._family.largest}: correct travel, home or counts_per_unit",
            )
        settings = self._family.settings(axis, scale.speed_counts())
        for setting in settings:
            self._set(dof, setting)
        _LOG.info("%s: %s, settings read back", name, axis.model)
        values = {str(one.register): one.value for one in settings}
        return CommissionedDrive(name, 0, number, self._family.mode, values)

    def configure(self) -> None:
        """Nothing: the bus watchdog is set when the motors are enabled."""

    def read_positions(self) -> list[int]:
        """See `DriveGroup.read_positions`."""
        return [self._read(dof, self._family.position) for dof in Dof]

    def start(self, positions: list[int]) -> None:
        """See `DriveGroup.start`."""
        self._goals = positions
        self._line.set_timeout(self._config.reply_timeout)
        now = self._sent_at = time.monotonic()
        for one, position in zip(self._feedback, positions, strict=True):
            one.position, one.age, one.silence, one.answered_at = position, 0, 0.0, now

    def probe(self) -> list[ServoFeedback]:
        """Read all servos once."""
        self._receive()
        return self._feedback

    def enable(self, *, reset_faults: bool) -> list[ServoFeedback]:
        """See `DriveGroup.enable`."""
        family = self._family
        self._line.set_timeout(self._config.request_timeout)
        for dof in Dof:
            if faults := self._read(dof, family.faults):
                if not reset_faults:
                    raise StateError(self.name(dof), *self._fault(faults))
                self._reset_fault(dof)
        for dof in Dof:
            self._was_enabled = self._is_moving = True
            self._write(dof, family.goal, self._goals[dof])
            self._write(dof, family.torque, 1)
            if not self._read(dof, family.torque):
                raise StateError(
                    self.name(dof), "its torque stays off", "Check its supply; power-cycle it"
                )
            if family.watchdog is not None:
                units = -(-self._config.heartbeat_timeout // _WATCHDOG_UNIT)
                self._write(dof, family.watchdog, max(1, int(units)))
        self.start(self._goals)
        return self.exchange(self._goals)

    def exchange(self, targets: list[int]) -> list[ServoFeedback]:
        """Send the set-points, read the positions.

        Raises:
            StateError: More than `heartbeat_timeout` passed since the last set-point.
            EmergencyError: A servo reports a fault.
            BusError: The port is lost.
        """
        now = time.monotonic()
        pause, self._sent_at = now - self._sent_at, now
        if pause > self._config.heartbeat_timeout:
            raise StateError(
                f"servos on {self._config.channel}",
                f"no set-point for {1e3 * pause:.0f} ms, which is more than "
                "drives.heartbeat_timeout",
                "Check the load of this computer (tautscope doctor)",
            )
        self._goals = targets
        self._line.write_all(dict(zip(self._ids, targets, strict=True)), self._family.goal)
        self._receive()
        return self._feedback

    def quick_stop(self) -> list[str]:
        """Hold each motor where it was in the last cycle, or release it, as `after_quick_stop`."""
        if not self._is_moving:
            return []
        self._is_moving = False
        goals = [one.position for one in self._feedback]
        unconfirmed = self._command_until(self._family.goal, goals)
        if self._config.after_quick_stop == "release" and not unconfirmed:
            return self._command_until(self._family.torque, [0, 0, 0])
        return unconfirmed

    def disable(self) -> list[str]:
        """Stop, then switch the torque off."""
        if not self._was_enabled:
            return []
        return self.quick_stop() or self._command_until(self._family.torque, [0, 0, 0])

    def close(self) -> None:
        """Release the port; a second call does nothing."""
        self._line.close()

    def _command_until(self, register: Register, values: list[int]) -> list[str]:
        """Repeat a sync write until each servo has the value; names of those that do not."""
        pending = set(Dof)
        deadline = time.monotonic() + self._config.state_timeout
        try:
            self._line.set_timeout(self._config.reply_timeout)
            while pending and time.monotonic() < deadline:
                if (
                    self._family.watchdog is not None
                ):  # it makes goals read-only once it has tripped
                    self._line.write_all(dict.fromkeys(self._ids, 0), self._family.watchdog)
                self._line.write_all(dict(zip(self._ids, values, strict=True)), register)
                for dof in sorted(pending):
                    try:
                        data, _ = self._line.read(self._ids[dof], register.address, register.size)
                    except NoAnswerError:
                        continue
                    if register.decode(data) == values[dof]:
                        pending.discard(dof)
        except DriveError:
            pass  # the port is lost
        return [self.name(dof) for dof in sorted(pending)]

    def _receive(self) -> None:
        """Read all servos with one packet; one by one in the cycle after one did not answer."""
        was_lossy, self._has_lost_answers = self._has_lost_answers, False
        answers: list[tuple[bytes, int] | None] = []
        try:
            if was_lossy:
                answers = [self._try_read(servo) for servo in self._ids]
            else:
                answers += self._line.read_all(self._ids, self._block, self._block_size)
        except NoAnswerError:
            answers = [None] * len(Dof)
        now = time.monotonic()
        for dof, answer in zip(Dof, answers, strict=True):
            one = self._feedback[dof]
            if answer is None:
                self._has_lost_answers = True
                one.age, one.silence = one.age + 1, now - one.answered_at
                continue
            one.age, one.silence, one.answered_at = 0, 0.0, now
            one.answers += 1
            one.position = self._family.position.decode(answer[0][: self._family.position.size])
        for dof, answer in zip(Dof, answers, strict=True):
            if answer is not None and self._is_moving:
                self._check_faults(dof, answer[1])

    def _try_read(self, servo: int) -> tuple[bytes, int] | None:
        try:
            return self._line.read(servo, self._block, self._block_size)
        except NoAnswerError:
            return None

    def _check_faults(self, dof: Dof, error: int) -> None:
        faults = error
        if self._family.alert:
            if not error & self._family.alert:
                return
            faults = self._read(dof, self._family.faults)
        if faults:
            raise EmergencyError(self.name(dof), *self._fault(faults))

    def _fault(self, faults: int) -> tuple[str, str]:
        names = ", ".join(self._family.faults_in(faults)) or "unknown"
        return f"it reports a fault: {names} (0x{faults:02X})", _FAULT_REMEDY

    def _reset_fault(self, dof: Dof) -> None:
        """Restart a Dynamixel; a Feetech clears its faults when the torque is switched off."""
        if self._family.alert:
            self._ask(dof, self._line.reboot)
            deadline = time.monotonic() + self._config.state_timeout
            while self._try_read(self._ids[dof]) is None and time.monotonic() < deadline:
                pass
            self.commission(dof)
        else:
            self._write(dof, self._family.torque, 0)
        if faults := self._read(dof, self._family.faults):
            raise StateError(self.name(dof), *self._fault(faults))
        position = self._read(dof, self._family.position)
        if abs(position - self._goals[dof]) > COUNTS_PER_TURN / 2:
            raise StateError(
                self.name(dof),
                f"its position changed from {self._goals[dof]} to {position} counts by the reset",
                f"It has forgotten its turns: correct drives.{dof.label}.home",
            )
        self._goals[dof] = position

    def _set(self, dof: Dof, setting: Setting) -> None:
        """Write a setting if it differs, and read it back; EEPROM wears out."""
        register, family = setting.register, self._family
        found = self._read(dof, register)
        wanted = found & ~setting.bits | setting.value
        if found == wanted:
            return
        if setting.is_stored and self._read(dof, family.torque):
            raise StateError(
                self.name(dof),
                f"{register} is {found} and must become {wanted}, but its torque is on",
                "Let nothing depend on the torque, and power-cycle it",
            )
        locks = setting.is_stored and family.lock is not None
        if locks and family.lock is not None:
            self._write(dof, family.lock, 0)
        self._write(dof, register, wanted)
        if locks and family.lock is not None:
            self._write(dof, family.lock, 1)
        if (found := self._read(dof, register)) != wanted:
            raise SettingRefusedError(
                self.name(dof),
                f"{register} was set to {wanted} and reads back {found}",
                "Look up in its manual which values it accepts, and in which state",
            )

    def _wrong_model(self, dof: Dof, number: int) -> tuple[str, str]:
        wanted = self._config[dof].model or ""
        return (
            f"it is a {_model_name(number)}, not a {wanted} ({MODELS[wanted].number})",
            f"Correct drives.{dof.label}.model or drives.{dof.label}.node",
        )

    def _read(self, dof: Dof, register: Register) -> int:
        data, _ = self._ask(
            dof, lambda servo: self._line.read(servo, register.address, register.size)
        )
        return register.decode(data)

    def _write(self, dof: Dof, register: Register, value: int) -> None:
        self._ask(dof, lambda servo: self._line.write(servo, register, value))

    def _ask(self, dof: Dof, transfer: Callable[[int], T]) -> T:
        try:
            return transfer(self._ids[dof])
        except NoAnswerError:
            what = "no answer"
            remedy = "Check its supply and cable"
            if not self._is_moving:
                remedy = (
                    f"Check its supply and cable, drives.{dof.label}.node and drives.bitrate: "
                    f"{self._line.search()}"
                )
            raise SilentDriveError(self.name(dof), what, remedy) from None


def _model_name(number: int) -> str:
    names = [name for name, model in MODELS.items() if model.number == number]
    return f"{names[0] if names else 'model unknown here'} ({number})"
