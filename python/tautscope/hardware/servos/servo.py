"""One servo on a line: its registers, settings and faults."""

import logging
import time
from collections.abc import Callable
from typing import Any, TypeVar

from tautscope.config import DrivesConfig
from tautscope.config.servos import COUNTS_PER_TURN, MODELS
from tautscope.dof import Motor
from tautscope.errors import ModeRefusedError, SettingRefusedError, SilentDriveError, StateError
from tautscope.hardware.drive_group import RESET, CommissionedDrive, DriveStatus
from tautscope.hardware.scale import Scale
from tautscope.hardware.servos.families import FAMILIES, Register, Setting
from tautscope.hardware.servos.line import NoAnswerError, ServoLine

T = TypeVar("T")
_LOG = logging.getLogger(__name__)
_REMEDY = f"Find the cause (load, supply, temperature; docs/hardware.md), then {RESET}"


class Servo:
    """One servo on an open line.

    Every method raises `SilentDriveError` if it does not answer, and `BusError` if the port is
    lost.
    """

    def __init__(self, config: DrivesConfig, dof: Motor, line: ServoLine) -> None:
        self._config, self._dof, self._line = config, dof, line
        self._family = FAMILIES[config.protocol]
        self._axis = config[dof]
        self._model = self._axis.model or ""
        self.id = self._axis.node
        self.name = f"{dof.label}, servo {self.id}"
        self.may_search = True
        """Whether the line may be searched if it is silent, which takes seconds."""

    def read(self, register: Register) -> int:
        """Read a register."""
        return self._ask(self._line.read, self.id, register)[0]

    def write(self, register: Register, value: int) -> None:
        """Write a register; it is not read back.

        Raises:
            SettingRefusedError: It refused the value.
        """
        self._ask(self._line.write, self.id, register, value)

    def status(self) -> DriveStatus:
        """Read model, torque, faults, voltage, temperature and position."""
        family = self._family
        number, position = self.read(family.model), self.read(family.position)
        has_torque, faults = bool(self.read(family.torque)), self.read(family.faults)
        voltage, temperature = self.read(family.voltage) / 10, self.read(family.temperature)
        names = family.faults_in(faults)
        state = f"fault: {', '.join(names) or hex(faults)}" if faults else "no fault"
        is_right = number == MODELS[self._model].number
        problem = self._wrong_model(number)[1] if not is_right else _REMEDY if faults else ""
        return DriveStatus(
            position,
            f"{_model_name(number)}; torque {'on' if has_torque else 'off'}; {state}; "
            f"{voltage:.1f} V; {temperature} °C",
            problem,
            data={
                "model": number,
                "torque": has_torque,
                "faults": names,
                "voltage": voltage,
                "temperature": temperature,
            },
        )

    def commission(self) -> CommissionedDrive:
        """Set the mode for several turns, speed and torque limit, and read them back.

        A servo with torque whose host failed is held where it is.

        Raises:
            ModeRefusedError: It is another model.
            StateError: A stored setting differs while the torque is on.
            SettingRefusedError: A setting was refused, or reads back differently.
        """
        number = self.read(self._family.model)
        if number != MODELS[self._model].number:
            raise ModeRefusedError(self.name, *self._wrong_model(number))
        scale = Scale(self._axis, self._dof)
        furthest = max(map(abs, scale.travel_counts()))
        if furthest > self._family.largest:
            raise SettingRefusedError(
                self.name,
                f"{self._dof.key}.travel is up to {furthest} counts from 0",
                f"It counts to {self._family.largest}: correct travel, home or counts_per_unit",
            )
        self._end_watchdog()
        settings = self._family.settings(self._axis, scale.speed_counts())
        for setting in settings:
            self._set(setting)
        _LOG.info("%s: %s, settings read back", self.name, self._model)
        values = {str(one.register): one.value for one in settings}
        return CommissionedDrive(self.name, 0, number, self._family.mode, values)

    def fault(self, faults: int) -> tuple[str, str]:
        """What a value of the faults means, and the remedy."""
        names = ", ".join(self._family.faults_in(faults)) or "unknown"
        return f"it reports a fault: {names} (0x{faults:02X})", _REMEDY

    def reset_fault(self, before: int) -> int:
        """Restart a Dynamixel; a Feetech clears its faults when the torque is switched off.

        Args:
            before: Its position [counts].

        Returns:
            Its position [counts].

        Raises:
            StateError: The fault remains, or it has forgotten its turns.
        """
        family = self._family
        if family.alert:
            self._ask(self._line.reboot, self.id)
            time.sleep(self._config.state_timeout / 2)
            self.commission()
        else:
            self.write(family.torque, 0)
        if faults := self.read(family.faults):
            raise StateError(self.name, *self.fault(faults))
        position = self.read(family.position)
        if abs(position - before) > COUNTS_PER_TURN / 2:
            raise StateError(
                self.name,
                f"its position changed from {before} to {position} counts by the reset",
                f"It has forgotten its turns: correct {self._dof.key}.home, or "
                "tautscope calibrate stops",
            )
        return position

    def _end_watchdog(self) -> None:
        """End the watchdog that a failed host left, without a motion to its goal.

        The goal cannot be written before the stop by the watchdog is ended, from when on a servo
        with torque goes there: the torque is off meanwhile.
        """
        family = self._family
        if family.watchdog is None or not (self.read(family.torque) and self.read(family.watchdog)):
            return
        self.write(family.torque, 0)
        self.write(family.watchdog, 0)
        self.write(family.goal, self.read(family.position))
        self.write(family.torque, 1)

    def _set(self, setting: Setting) -> None:
        """Write a setting if it differs, and read it back; EEPROM wears out."""
        register, family = setting.register, self._family
        found = self.read(register)
        wanted = found & ~setting.bits | setting.value
        if found == wanted:
            return
        if setting.is_stored and self.read(family.torque):
            raise StateError(
                self.name,
                f"{register} is {found} and must become {wanted}, but its torque is on",
                "Let nothing depend on the torque, and power-cycle it",
            )
        lock = family.lock if setting.is_stored else None
        if lock is not None:
            self.write(lock, 0)
        self.write(register, wanted)
        if lock is not None:
            self.write(lock, 1)
        if (found := self.read(register)) != wanted:
            raise SettingRefusedError(
                self.name,
                f"{register} was set to {wanted} and reads back {found}",
                "Look up in its manual which values it accepts, and in which state",
            )

    def _wrong_model(self, number: int) -> tuple[str, str]:
        what = f"it is a {_model_name(number)}, not a {self._model} ({MODELS[self._model].number})"
        return what, f"Correct {self._dof.key}.model or {self._dof.key}.node"

    def _ask(self, transfer: Callable[..., T], *arguments: Any) -> T:
        try:
            return transfer(*arguments)
        except NoAnswerError:
            remedy = "Check its supply and cable"
            if self.may_search:
                remedy += f", {self._dof.key}.node and drives.bitrate: "
                remedy += self._line.found
            raise SilentDriveError(self.name, "no answer", remedy) from None


def _model_name(number: int) -> str:
    names = [name for name, model in MODELS.items() if model.number == number]
    return f"{names[0] if names else 'model unknown here'} ({number})"
