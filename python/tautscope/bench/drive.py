"""A simulated CiA 402 drive."""

import math
from collections import deque
from collections.abc import Callable, Collection

from tautscope.bench.canopen_node import OUT_OF_RANGE, CanopenNode, Key, Send
from tautscope.config import DrivesConfig
from tautscope.dof import Motor
from tautscope.hardware.cia402 import Mode, State

_STATUSWORD = {
    State.NOT_READY: 0x0000,
    State.SWITCH_ON_DISABLED: 0x0240,
    State.READY: 0x0221,
    State.SWITCHED_ON: 0x0233,
    State.OPERATION_ENABLED: 0x0237,
    State.QUICK_STOP_ACTIVE: 0x0217,
    State.FAULT: 0x0208,
}
_CONNECTION_LOST = {1: State.FAULT, 2: State.SWITCH_ON_DISABLED, 3: State.QUICK_STOP_ACTIVE}
"""0x6007 -> state after a lost connection; else the drive ignores it."""
OVERHEATED = 0x4310
"""Emergency code: excess temperature of the drive."""
SERIAL_NUMBERS = 0x7A00_0000
"""Serial number of a simulated drive, minus its node id."""


class SimulatedDrive(CanopenNode):
    """A drive with the CiA 402 state machine, modes 7 and 8, limits and quick stop.

    Args:
        dof: DOF of its motor.
        config: The true rig.
        send: See `CanopenNode`.
        log: Called with the time and the event.
        modes: Supported modes of operation.
        absent: See `CanopenNode`.
    """

    def __init__(
        self,
        dof: Motor,
        config: DrivesConfig,
        send: Send,
        log: Callable[[float, str], None],
        *,
        modes: frozenset[int],
        absent: Collection[int] = (),
    ) -> None:
        super().__init__(config[dof].node, send, absent)
        self.cycle = config.cycle
        self.status = State.NOT_READY
        self.demand = 0
        self.refuses_mode = False
        self._log = log
        self._modes = modes
        self._setpoint_buffer: deque[int] = deque(maxlen=64)
        self._is_interpolating = False
        self._is_limited = False
        self._is_reset_armed = True  # a rising edge of bit 7 resets a fault

    def boot(self, now: float) -> None:
        """Power on; the motor stays where it is, without voltage."""
        actual = self.values.get((0x6064, 0), 0)
        super().boot(now)
        self.values[0x6502, 0] = sum(1 << (mode - 1) for mode in self._modes)
        self.values[0x6064, 0] = actual
        if (0x1018, 4) in self.entries:
            self.values[0x1018, 4] = SERIAL_NUMBERS + self.node
        self.demand = actual
        self._enter(State.SWITCH_ON_DISABLED, now)

    def set_position(self, counts: int) -> None:
        """Set the position actual value [counts]."""
        self.values[0x6064, 0] = counts
        if self.status not in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE):
            self.demand = counts

    def fail(self, now: float) -> None:
        """Simulate an internal fault: emergency object and fault state."""
        self.emergency(OVERHEATED, 0x09)
        self._enter(State.FAULT, now)

    def on_write(self, key: Key, value: int, now: float) -> int | None:
        """Apply controlword and mode of operation at once."""
        if key == (0x6040, 0):
            self._control(value, now)
        elif key == (0x6060, 0):
            if value not in self._modes:
                return OUT_OF_RANGE
            if not self.refuses_mode:
                self.values[0x6061, 0] = value
        elif key == (0x60C2, 1) and self._is_interpolating:
            return OUT_OF_RANGE
        return None

    def on_sync(self, now: float) -> None:
        """Send the TxPDO, then apply the set-point."""
        self._update_statusword()
        self.send_pdo(0x1800)
        if self.status is State.OPERATION_ENABLED:
            self._apply_setpoint()
        elif self.status is State.QUICK_STOP_ACTIVE and self.values[0x605A, 0] == 2:
            self._enter(State.SWITCH_ON_DISABLED, now)

    def on_connection_lost(self, now: float) -> None:
        """React as set in 0x6007."""
        target = _CONNECTION_LOST.get(self.values.get((0x6007, 0), 0))
        if self.status is State.OPERATION_ENABLED and target is not None:
            self._enter(target, now)

    def _control(self, word: int, now: float) -> None:
        """Apply a controlword: bits 7, 3, 2, 1, 0 of the command table of CiA 402."""
        status = self.status
        resets = bool(word & 0x80) and self._is_reset_armed
        self._is_reset_armed = not word & 0x80
        if status is State.FAULT:
            if resets:
                self.emergency(0, 0)
                self._enter(State.SWITCH_ON_DISABLED, now)
            return
        if not word & 0x02:
            target = State.SWITCH_ON_DISABLED
        elif not word & 0x04:
            enabled = status in (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE)
            target = State.QUICK_STOP_ACTIVE if enabled else State.SWITCH_ON_DISABLED
        elif status is State.QUICK_STOP_ACTIVE:
            return  # only disable voltage leaves this state
        elif not word & 0x01:
            target = State.READY
        elif status is State.SWITCH_ON_DISABLED:
            return  # shutdown must come first
        else:
            target = State.OPERATION_ENABLED if word & 0x08 else State.SWITCHED_ON
        self._is_interpolating = target is State.OPERATION_ENABLED and bool(word & 0x10)
        self._enter(target, now)

    def _enter(self, target: State, now: float) -> None:
        if target is self.status:
            return
        self.status = target
        if target is State.OPERATION_ENABLED:
            self._setpoint_buffer.clear()
            self.demand = self.values[0x6064, 0]
            self.values[0x607A, 0] = self.values[0x60C1, 1] = self.demand
        else:
            self._is_interpolating = False
        self._update_statusword()
        self._log(now, target.value)

    def _apply_setpoint(self) -> None:
        if self.values[0x6061, 0] == Mode.CYCLIC_SYNCHRONOUS_POSITION:
            target = self.values[0x607A, 0]
        elif self.values[0x6061, 0] == Mode.INTERPOLATED_POSITION:
            self._setpoint_buffer.append(self.values[0x60C1, 1])
            if not self._is_interpolating:
                return
            target = self._setpoint_buffer.popleft()
        else:
            return
        lower, upper = (self.values.get((0x607D, sub), 0) for sub in (1, 2))
        limited = min(max(target, lower), upper) if upper > lower else target
        max_step = math.ceil(self.values.get((0x607F, 0), 0xFFFF_FFFF) * self.cycle) + 1
        self._is_limited = limited != target
        self.demand += min(max(limited - self.demand, -max_step), max_step)

    def _update_statusword(self) -> None:
        word = _STATUSWORD[self.status]
        if self.status is State.OPERATION_ENABLED:
            follows = self.values[0x6061, 0] == Mode.CYCLIC_SYNCHRONOUS_POSITION
            word |= (follows or self._is_interpolating) << 12
            word |= self._is_limited << 11
        self.values[0x6041, 0] = word
