"""The registers of each family of servos that this package uses.

Sources: the e-manual of Dynamixel X (control table, protocol 2.0) and Feetech's memory table of the
SMS and STS series. Not run on a servo.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from tautscope.config import AxisConfig
from tautscope.config.servos import COUNTS_PER_TURN


@dataclass(frozen=True, slots=True)
class Register:
    """A little-endian number in the memory of a servo.

    Attributes:
        address, size: Its place [byte].
        name: Its name in the manual.
        sign: None of a number without sign; the number of the bit that is the sign of a magnitude;
            -1 of two's complement.
    """

    address: int
    size: int
    name: str
    sign: int | None = None

    def __str__(self) -> str:
        return f"{self.name} ({self.address})"

    def encode(self, value: int) -> bytes:
        """Encode a value; `OverflowError` if it does not fit."""
        if self.sign is None or self.sign < 0:
            return value.to_bytes(self.size, "little", signed=self.sign is not None)
        if abs(value) >= 1 << self.sign:
            raise OverflowError(f"{value} does not fit {self}")
        return (abs(value) | (value < 0) << self.sign).to_bytes(self.size, "little")

    def decode(self, data: bytes) -> int:
        """Decode the value."""
        value = int.from_bytes(data, "little", signed=self.sign == -1)
        if self.sign is None or self.sign < 0:
            return value
        magnitude = value & ((1 << self.sign) - 1)
        return -magnitude if value >> self.sign & 1 else magnitude


class Setting(NamedTuple):
    """A value of a register, which is in EEPROM if it survives a loss of power.

    `bits` are those that the setting is about; the others keep their values.
    """

    register: Register
    value: int
    is_stored: bool = False
    bits: int = -1


@dataclass(frozen=True, slots=True)
class Family:
    """A family of servos.

    Attributes:
        controller: Class of `rustypot`.
        rates: Bit rates at which a search looks, the factory's first [bit/s].
        fault_names: Bit of `faults` -> name.
        settings: The settings of a motor, for its configuration and speed limit [counts/s].
        mode: Mode of operation: positions of several turns.
        watchdog: Register of the bus watchdog, in 20 ms; None if the family has none.
        lock: Register that must be 0 to write EEPROM; None if the family has none.
        alert: Bit of the error of an answer that says that `faults` are not 0; 0 if the error is
            `faults`.
        largest: Largest goal [counts].
    """

    controller: str
    rates: tuple[int, ...]
    torque: Register
    goal: Register
    position: Register
    voltage: Register
    temperature: Register
    faults: Register
    model: Register
    fault_names: dict[int, str]
    settings: Callable[[AxisConfig, int], list[Setting]]
    mode: int
    watchdog: Register | None
    lock: Register | None
    alert: int
    largest: int

    def faults_in(self, bits: int) -> list[str]:
        """Names of the faults in a value of `faults`."""
        return [name for bit, name in self.fault_names.items() if bits >> bit & 1]


_PWM_LIMIT = 885
"""Goal PWM at the full supply voltage."""
_SPEED_UNIT = 0.229 / 60 * COUNTS_PER_TURN
"""Profile velocity 1 [counts/s]."""
_EXTENDED_POSITION = 4
_POSITION = 0


def _dynamixel_settings(axis: AxisConfig, speed: int) -> list[Setting]:
    return [
        Setting(Register(9, 1, "Return Delay Time"), 0, is_stored=True),
        Setting(Register(10, 1, "Drive Mode"), 0, is_stored=True),
        Setting(Register(11, 1, "Operating Mode"), _EXTENDED_POSITION, is_stored=True),
        Setting(Register(20, 4, "Homing Offset", -1), axis.homing_offset, is_stored=True),
        Setting(Register(68, 1, "Status Return Level"), 2),
        Setting(Register(98, 1, "Bus Watchdog"), 0),
        Setting(Register(100, 2, "Goal PWM", -1), round(axis.torque_limit * _PWM_LIMIT)),
        Setting(Register(108, 4, "Profile Acceleration"), 0),
        Setting(Register(112, 4, "Profile Velocity"), math.ceil(speed / _SPEED_UNIT)),
    ]


def _feetech_settings(axis: AxisConfig, speed: int) -> list[Setting]:
    return [
        Setting(Register(7, 1, "Return Delay"), 0, is_stored=True),
        Setting(Register(8, 1, "Response Level"), 1, is_stored=True),
        # Both limits at 0: positions of several turns.
        Setting(Register(9, 2, "Min Angle Limit"), 0, is_stored=True),
        Setting(Register(11, 2, "Max Angle Limit"), 0, is_stored=True),
        Setting(Register(18, 1, "Phase"), 0x10, is_stored=True, bits=0x10),
        Setting(Register(31, 2, "Offset", 11), -axis.homing_offset, is_stored=True),
        Setting(Register(33, 1, "Operation Mode"), _POSITION, is_stored=True),
        Setting(Register(41, 1, "Acceleration"), 0),
        Setting(Register(44, 2, "Goal Time"), 0),
        Setting(Register(46, 2, "Goal Speed", 15), speed),
        Setting(Register(48, 2, "Torque Limit"), round(axis.torque_limit * 1000)),
    ]


FAMILIES = {
    "dynamixel": Family(
        controller="Xl430PyController",
        rates=(57_600, 1_000_000, 115_200, 2_000_000, 3_000_000, 4_000_000, 9_600),
        torque=Register(64, 1, "Torque Enable"),
        goal=Register(116, 4, "Goal Position", -1),
        position=Register(132, 4, "Present Position", -1),
        voltage=Register(144, 2, "Present Input Voltage"),
        temperature=Register(146, 1, "Present Temperature"),
        faults=Register(70, 1, "Hardware Error Status"),
        model=Register(0, 2, "Model Number"),
        fault_names={
            0: "input voltage",
            2: "overheating",
            3: "motor encoder",
            4: "electrical shock",
            5: "overload",
        },
        settings=_dynamixel_settings,
        mode=_EXTENDED_POSITION,
        watchdog=Register(98, 1, "Bus Watchdog"),
        lock=None,
        alert=0x80,
        largest=256 * COUNTS_PER_TURN,
    ),
    "feetech": Family(
        controller="Sts3215PyController",
        rates=(1_000_000, 500_000, 115_200),
        torque=Register(40, 1, "Torque Switch"),
        goal=Register(42, 2, "Target Position", 15),
        position=Register(56, 2, "Current Position", 15),
        voltage=Register(62, 1, "Current Voltage"),
        temperature=Register(63, 1, "Current Temperature"),
        faults=Register(65, 1, "Servo Status"),
        model=Register(3, 2, "Model Number"),
        fault_names={
            0: "input voltage",
            1: "position sensor",
            2: "overheating",
            3: "overcurrent",
            5: "overload",
        },
        settings=_feetech_settings,
        mode=_POSITION,
        watchdog=None,
        lock=Register(55, 1, "Lock"),
        alert=0,
        largest=7 * COUNTS_PER_TURN,
    ),
}
"""`drives.protocol` -> family."""
