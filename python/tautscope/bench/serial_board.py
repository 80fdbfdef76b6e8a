"""A simulated microcontroller that speaks the serial line protocol, docs/serial.md."""

from collections.abc import Sequence

from tautscope.hardware.serial_line import frames
from tautscope.hardware.serial_line.frames import Hello, Limits, Refusal, Request, State, Status

_STILL = (State.DISABLED, State.FAULT)


class SerialBoard:
    """The state machine; its owner moves the motors, and sets `positions` and `faults`.

    Attributes:
        state: What it does.
        targets, positions: Of each axis [counts].
        faults: Fault of each axis, 0 if it has none.
        watchdog, heard_at: Watchdog time, and when set-points came last [ms].
    """

    def __init__(self, axes: Sequence[Limits]) -> None:
        self.axes = tuple(axes)
        self.state = State.DISABLED
        self.targets = [0] * len(axes)
        self.positions = [0] * len(axes)
        self.faults = [0] * len(axes)
        self.watchdog = self.heard_at = 0

    def answer(self, message: bytes, now: int) -> bytes:
        """The frame that answers a message at a time [ms]; empty if it is no request."""
        if len(message) < 3 or message[0] >= 0x80:
            return b""
        self.poll(now)
        kind, number = message[0], int.from_bytes(message[1:3], "little")
        refusal = self._serve(kind, message[3:], now)
        if kind == Request.HELLO and not refusal:
            return frames.hello_answer(number, Hello(frames.VERSION, self.axes))
        status = Status(number, self.state, refusal, tuple(self.faults), tuple(self.positions))
        return frames.status_answer(kind, status)

    def poll(self, now: int) -> None:
        """Stop the motors after silence, or if one has a fault; at a time [ms]."""
        if self.state in _STILL:
            return
        is_silent = self.state == State.ENABLED and now - self.heard_at >= self.watchdog
        if is_silent or any(self.faults):
            self._stop()
            self.state = State.FAULT if any(self.faults) else State.SILENCE

    def _serve(self, kind: int, body: bytes, now: int) -> Refusal:
        sizes = {Request.ENABLE: 2, Request.SETPOINTS: 4 * len(self.axes)}
        if kind not in list(Request):
            return Refusal.UNKNOWN
        if len(body) != sizes.get(Request(kind), 0):
            return Refusal.LENGTH
        if kind == Request.ENABLE:
            return self._enable(int.from_bytes(body, "little"), now)
        if kind == Request.SETPOINTS:
            return self._set(frames.read_setpoints(body), now)
        if kind in (Request.STOP, Request.DISABLE):
            self._stop()
            if kind == Request.DISABLE:
                self.state = State.DISABLED
            elif self.state not in _STILL:
                self.state = State.STOPPED
        return Refusal.DONE

    def _enable(self, watchdog: int, now: int) -> Refusal:
        if not watchdog:
            return Refusal.RANGE
        if self.state == State.FAULT or any(self.faults):
            return Refusal.STATE
        self._stop()
        self.state, self.watchdog, self.heard_at = State.ENABLED, watchdog, now
        return Refusal.DONE

    def _set(self, targets: Sequence[int], now: int) -> Refusal:
        if self.state != State.ENABLED:
            return Refusal.STATE
        for target, limits in zip(targets, self.axes, strict=True):
            if not limits.lower <= target <= limits.upper:
                return Refusal.RANGE
        self.targets, self.heard_at = list(targets), now
        return Refusal.DONE

    def _stop(self) -> None:
        self.targets = list(self.positions)
