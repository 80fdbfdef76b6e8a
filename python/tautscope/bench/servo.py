"""A simulated servo: its memory, its motion and its faults."""

from collections.abc import Callable

from tautscope.config import AxisConfig
from tautscope.config.servos import COUNTS_PER_TURN, MODELS
from tautscope.hardware.servos.families import FAMILIES, Register

OVERLOAD = 1 << 5
"""Overload, in the faults of either family."""
_OVERLOAD_DISTANCE, _OVERLOAD_TIME = 50, 1.0
"""A motor that stays farther than this from its goal [counts] for this time [s] is overloaded."""
_FULL_SPEED = 0x3FFF_FFFF
_FACTORY = {
    "dynamixel": {(6, 1): 48, (8, 1): 3, (9, 1): 250, (11, 1): 3, (13, 1): 2, (36, 2): 885}
    | {(48, 4): 4095, (63, 1): 0x35, (68, 1): 2, (100, 2): 885, (144, 2): 50, (146, 1): 31},
    "feetech": {(0, 1): 3, (1, 1): 10, (7, 1): 250, (8, 1): 1, (11, 2): 4095, (16, 2): 1000}
    | {(18, 1): 0x0C, (48, 2): 1000, (55, 1): 1, (62, 1): 74, (63, 1): 30},
}
"""Values of the factory, by address and size."""
_WRITABLE = {"dynamixel": ((7, 64), (64, 70), (76, 120)), "feetech": ((5, 56),)}
"""Addresses that a client may write."""
_RANGES = {11: (0, 16), 64: (0, 1), 68: (0, 2), 98: (0, 127)}
"""Values that registers of a Dynamixel take, by address."""
INSTRUCTION, CHECKSUM, DATA_RANGE, DATA_LENGTH, ACCESS = 2, 3, 4, 5, 7
"""Error numbers of Dynamixel, protocol 2.0."""


class SimulatedServo:
    """One servo.

    Args:
        axis: Of the true rig: id, model.
        protocol: Its family.
        shaft: Where its horn is [counts], with all turns; these are unknown to it.
        log: Called with the time and the event.
    """

    def __init__(
        self, axis: AxisConfig, protocol: str, shaft: int, log: Callable[[float, str], None]
    ) -> None:
        self.family = FAMILIES[protocol]
        self.model = MODELS[axis.model or ""]
        self._is_dynamixel = protocol == "dynamixel"
        self._id_address = 7 if self._is_dynamixel else 5
        self._writable = _WRITABLE[protocol]
        self.memory = bytearray(256)
        self.stored = bytearray(256)
        self.registered: tuple[int, bytes] | None = None
        self.shaft = shaft
        self.demand = 0.0
        """Where its position loop wants the horn [counts], with all turns."""
        self.is_blocked = False
        self._turns = 0
        self._log = log
        self._far_since: float | None = None
        self.heard_at = 0.0
        """Time of the last instruction packet on the line."""
        identity = {(self._id_address, 1): axis.node}
        for (address, size), value in (_FACTORY[protocol] | identity).items():
            self.memory[address : address + size] = value.to_bytes(size, "little")
        self.set(self.family.model, self.model.number)
        self.stored[:] = self.memory
        self.restart(0.0)

    @property
    def id(self) -> int:
        """Its id, in its memory."""
        return self.memory[self._id_address]

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
        if refusal := self._refusal(address, data):
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

    def advance(self, period: float, now: float) -> int:
        """Advance the position loop by a period [s]; the position that it demands [counts]."""
        family, watchdog = self.family, self.family.watchdog
        has_torque = self.get(family.torque) == 1
        limit = self.get(watchdog) if watchdog is not None and has_torque else 0
        if watchdog is not None and 0 < limit < 128 and now - self.heard_at > limit * 0.02:
            self.set(watchdog, 255)
            self._log(now, "bus watchdog")
        is_stopped = watchdog is not None and self.get(watchdog) == 255
        if has_torque and not is_stopped:
            goal = self.get(family.goal) + self._offset
            step = self._speed * period
            self.demand += min(max(goal - self.demand, -step), step)
            self._check_load(goal, now)
        return round(self.demand)

    def move(self, shaft: int) -> None:
        """Move the horn [counts]."""
        if not self.is_blocked:
            self.shaft = shaft
            if self.get(self.family.torque) != 1:
                self.demand = self.shaft
        self._publish()

    @property
    def _offset(self) -> int:
        """What the shaft's position is more than the position that the servo reports."""
        turns = self._turns if self._has_turns else self.shaft // COUNTS_PER_TURN
        return turns * COUNTS_PER_TURN - self._homing_offset

    def _publish(self) -> None:
        self.set(self.family.position, self.shaft - self._offset)

    def _check_load(self, goal: float, now: float) -> None:
        if abs(goal - self.shaft) <= _OVERLOAD_DISTANCE or not self.is_blocked:
            self._far_since = None
        elif self._far_since is None:
            self._far_since = now
        elif now - self._far_since > _OVERLOAD_TIME:
            self.fail(OVERLOAD, now)

    def _number(self, address: int, size: int) -> int:
        return int.from_bytes(self.read(address, size), "little")

    def _refusal(self, address: int, data: bytes) -> int:
        """0 if a client may write this, or the number of the error."""
        memory, end = self.memory, address + len(data)
        if not any(low <= address and end <= high for low, high in self._writable):
            return ACCESS
        if not self._is_dynamixel:
            return 0
        if address < 64 and memory[64]:
            return ACCESS
        if address < 120 and end > 100 and memory[98] == 255:
            return DATA_RANGE
        low, high = _RANGES.get(address, (0, 255))
        if not low <= data[0] <= high:
            return DATA_RANGE
        goal = int.from_bytes(data, "little", signed=True)
        is_beyond = address == 116 and memory[11] == 3 and not 0 <= goal < COUNTS_PER_TURN
        return DATA_RANGE if is_beyond else 0

    @property
    def _speed(self) -> float:
        """Largest speed by its settings [counts/s]."""
        unit = COUNTS_PER_TURN / 60
        if self._is_dynamixel:
            profile = self._number(112, 4) or _FULL_SPEED
            return min(0.229 * profile, self._number(100, 2) / 885 * self.model.speed) * unit
        limit = self._number(46, 2) & 0x7FFF or _FULL_SPEED
        return min(limit, self._number(48, 2) / 1000 * self.model.speed * unit)

    @property
    def _has_turns(self) -> bool:
        """Whether it counts turns by its settings."""
        if self._is_dynamixel:
            return self.memory[11] == 4
        return self.memory[9:13] == bytes(4) and bool(self.memory[18] & 0x10)

    @property
    def _homing_offset(self) -> int:
        """What the reported position is more than that of the encoder [counts]."""
        if self._is_dynamixel:
            return int.from_bytes(self.memory[20:24], "little", signed=True)
        word = self._number(31, 2)
        return (word & 0x7FF) if word & 0x800 else -(word & 0x7FF)
