"""A simulated servo: its memory, its motion and its faults."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from tautscope.config import AxisConfig
from tautscope.config.servos import COUNTS_PER_TURN, MODELS
from tautscope.hardware.scale import Scale
from tautscope.hardware.servos.families import FAMILIES, Register

OVERLOAD = 1 << 5
"""Overload, in the faults of either family."""
_OVERLOAD_DISTANCE, _OVERLOAD_TIME = 50, 1.0
"""A motor that stays farther than this from its goal [counts] for this time [s] is overloaded."""
_FULL_SPEED = 0x3FFF_FFFF
INSTRUCTION, CHECKSUM, DATA_RANGE, DATA_LENGTH, ACCESS = 2, 3, 4, 5, 7
"""Error numbers of Dynamixel, protocol 2.0."""


class Rules(Protocol):
    """What differs between the families, for a simulated servo."""

    def defaults(self, servo: SimulatedServo) -> None: ...  # noqa: D102
    def refusal(self, servo: SimulatedServo, address: int, data: bytes) -> int: ...  # noqa: D102
    def speed(self, servo: SimulatedServo) -> float: ...  # noqa: D102
    def has_turns(self, servo: SimulatedServo) -> bool: ...  # noqa: D102
    def homing_offset(self, servo: SimulatedServo) -> int: ...  # noqa: D102


class SimulatedServo:
    """One servo.

    Args:
        axis: Of the true rig: id, model, units.
        label: The DOF's name.
        protocol: Its family.
        log: Called with the time and the event.
    """

    def __init__(
        self, axis: AxisConfig, label: str, protocol: str, log: Callable[[float, str], None]
    ) -> None:
        self.family = FAMILIES[protocol]
        self.first_id = axis.node
        self.model = MODELS[axis.model or ""]
        self.scale = Scale(axis, label)
        self.rules: Rules = _RULES[protocol]
        self.memory = bytearray(256)
        self.stored = bytearray(256)
        self.registered: tuple[int, bytes] | None = None
        self.shaft = 0
        """Where its horn is [counts], with all turns."""
        self.demand = 0.0
        """Where its position loop wants the horn [counts], with all turns."""
        self.is_blocked = False
        self._turns = 0
        self._log = log
        self._far_since: float | None = None
        self._heard_at = 0.0
        self.rules.defaults(self)
        self.stored[:] = self.memory

    @property
    def id(self) -> int:
        """Its id, in its memory."""
        return self.memory[7 if self.family.alert else 5]

    def restart(self, now: float) -> None:
        """Power on: without torque, turns, and settings that are not stored."""
        self.memory[:] = self.stored
        self._turns = self.shaft // COUNTS_PER_TURN
        self.demand = self.shaft
        self._publish()
        self.set(self.family.goal, self.get(self.family.position))
        self._log(now, "restart")

    def get(self, register: Register) -> int:
        """The value of a register."""
        return register.decode(bytes(self.memory[register.address :][: register.size]))

    def set(self, register: Register, value: int) -> None:
        """Set a register, whether a client may write it or not."""
        self.memory[register.address : register.address + register.size] = register.encode(value)

    def read(self, address: int, size: int) -> bytes:
        """Bytes of the memory."""
        return bytes(self.memory[address : address + size])

    def write(self, address: int, data: bytes, now: float) -> int:
        """Write as a client does; 0, or the number of the error."""
        if refusal := self.rules.refusal(self, address, data):
            return refusal
        torque = self.get(self.family.torque)
        self.memory[address : address + len(data)] = data
        if not self.family.lock or not self.get(self.family.lock):
            end = min(address + len(data), self.family.torque.address)
            self.stored[address:end] = self.memory[address:end]
        if address == self.family.torque.address and not self.family.alert:
            self.set(self.family.faults, 0)
        if torque != self.get(self.family.torque):
            self.demand = self.shaft
            if not torque and self.family.alert:  # a Dynamixel starts where it is
                self.set(self.family.goal, self.get(self.family.position))
            self._log(now, "torque off" if torque else "torque on")
        return 0

    def hear(self, now: float) -> None:
        """Take note of an instruction packet on the line."""
        self._heard_at = now

    @property
    def error(self) -> int:
        """The error of an answer that refuses nothing."""
        faults = self.get(self.family.faults)
        return self.family.alert * bool(faults) if self.family.alert else faults

    def fail(self, bits: int, now: float) -> None:
        """Report a fault, and switch the torque off."""
        self.set(self.family.faults, bits)
        self.memory[self.family.torque.address] = 0
        self._log(now, "fault: " + ", ".join(self.family.faults_in(bits)))

    def advance(self, period: float, now: float) -> float:
        """Advance the position loop by a period [s]; the position that it demands [m or rad]."""
        family, watchdog = self.family, self.family.watchdog
        has_torque = self.get(family.torque) == 1
        limit = self.get(watchdog) if watchdog is not None and has_torque else 0
        if watchdog is not None and 0 < limit < 128 and now - self._heard_at > limit * 0.02:
            self.set(watchdog, 255)
            self._log(now, "bus watchdog")
        is_stopped = watchdog is not None and self.get(watchdog) == 255
        if has_torque and not is_stopped:
            goal = self.get(family.goal) + self._offset
            step = self.rules.speed(self) * period
            self.demand += min(max(goal - self.demand, -step), step)
            self._check_load(goal, now)
        return self.scale.to_position(round(self.demand))

    def move(self, position: float) -> None:
        """Move the horn to a position of the DOF [m or rad]."""
        if not self.is_blocked:
            self.shaft = self.scale.to_counts(position)
            if self.get(self.family.torque) != 1:
                self.demand = self.shaft
        self._publish()

    @property
    def _offset(self) -> int:
        """What the shaft's position is more than the position that the servo reports."""
        turns = self._turns if self.rules.has_turns(self) else self.shaft // COUNTS_PER_TURN
        return turns * COUNTS_PER_TURN - self.rules.homing_offset(self)

    def _publish(self) -> None:
        self.set(self.family.position, self.shaft - self._offset)

    def _check_load(self, goal: float, now: float) -> None:
        if abs(goal - self.shaft) <= _OVERLOAD_DISTANCE or not self.is_blocked:
            self._far_since = None
        elif self._far_since is None:
            self._far_since = now
        elif now - self._far_since > _OVERLOAD_TIME:
            self.fail(OVERLOAD, now)


_WRITABLE = ((7, 64), (64, 70), (76, 120))
"""Addresses that a client of a Dynamixel may write."""
_RANGES = {11: (0, 16), 64: (0, 1), 68: (0, 2), 98: (0, 127)}
"""Values that registers of a Dynamixel take, by address."""


class _DynamixelRules:
    def defaults(self, servo: SimulatedServo) -> None:
        identity = {(0, 2): servo.model.number, (6, 1): 48, (7, 1): servo.first_id, (8, 1): 3}
        stored = {(9, 1): 250, (11, 1): 3, (13, 1): 2, (36, 2): 885, (48, 4): 4095, (63, 1): 0x35}
        _fill(servo.memory, identity | stored)
        _fill(servo.memory, {(68, 1): 2, (100, 2): 885, (144, 2): 50, (146, 1): 31})

    def refusal(self, servo: SimulatedServo, address: int, data: bytes) -> int:
        end = address + len(data)
        if not any(low <= address and end <= high for low, high in _WRITABLE):
            return ACCESS
        if address < 64 and servo.memory[64]:
            return ACCESS
        if address < 120 and end > 100 and servo.memory[98] == 255:
            return DATA_RANGE
        low, high = _RANGES.get(address, (0, 255))
        if not low <= data[0] <= high:
            return DATA_RANGE
        goal = int.from_bytes(data, "little", signed=True)
        if address == 116 and servo.memory[11] == 3 and not 0 <= goal < COUNTS_PER_TURN:
            return DATA_RANGE
        return 0

    def speed(self, servo: SimulatedServo) -> float:
        profile = int.from_bytes(servo.memory[112:116], "little") or _FULL_SPEED
        share = int.from_bytes(servo.memory[100:102], "little") / 885
        unit = COUNTS_PER_TURN / 60
        return min(0.229 * profile, share * servo.model.speed) * unit

    def has_turns(self, servo: SimulatedServo) -> bool:
        return servo.memory[11] == 4

    def homing_offset(self, servo: SimulatedServo) -> int:
        return int.from_bytes(servo.memory[20:24], "little", signed=True)


class _FeetechRules:
    def defaults(self, servo: SimulatedServo) -> None:
        identity = {(0, 1): 3, (1, 1): 10, (3, 2): servo.model.number, (5, 1): servo.first_id}
        stored = {(7, 1): 250, (8, 1): 1, (11, 2): 4095, (16, 2): 1000, (18, 1): 0x0C}
        _fill(servo.memory, identity | stored)
        _fill(servo.memory, {(48, 2): 1000, (55, 1): 1, (62, 1): 74, (63, 1): 30})

    def refusal(self, servo: SimulatedServo, address: int, data: bytes) -> int:
        is_writable = address >= 5 and address + len(data) <= 56
        return 0 if is_writable else ACCESS

    def speed(self, servo: SimulatedServo) -> float:
        limit = int.from_bytes(servo.memory[46:48], "little") & 0x7FFF or _FULL_SPEED
        share = int.from_bytes(servo.memory[48:50], "little") / 1000
        return min(limit, share * servo.model.speed * COUNTS_PER_TURN / 60)

    def has_turns(self, servo: SimulatedServo) -> bool:
        return servo.memory[9:13] == bytes(4) and bool(servo.memory[18] & 0x10)

    def homing_offset(self, servo: SimulatedServo) -> int:
        word = int.from_bytes(servo.memory[31:33], "little")
        return (word & 0x7FF) if word & 0x800 else -(word & 0x7FF)


_RULES: dict[str, Rules] = {"dynamixel": _DynamixelRules(), "feetech": _FeetechRules()}


def _fill(memory: bytearray, values: dict[tuple[int, int], int]) -> None:
    """Set values by address and size."""
    for (address, size), value in values.items():
        memory[address : address + size] = value.to_bytes(size, "little")
