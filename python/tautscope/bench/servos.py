"""Three simulated servos behind a pseudo-terminal, with fault injection.

    with SimulatedServos(config, plant): ...  # a client opens drives.channel as a serial port

The servos move by themselves, as long as they have power: after each cycle of a client (sync write
of goals, sync read), and by the clock when no client cycles.
"""

from __future__ import annotations

import fcntl
import heapq
import itertools
import os
import select
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from tautscope.bench import servo_packets as packets
from tautscope.bench.motors import SimulatedMotors
from tautscope.bench.servo import (
    CHECKSUM,
    DATA_LENGTH,
    INSTRUCTION,
    OVERLOAD,
    SimulatedServo,
)
from tautscope.bench.servo_packets import DynamixelPackets, FeetechPackets, Packet
from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import ConfigError

FaultKind = Literal["drop", "delay", "fault", "freeze", "restart"]
"""drop: neither sends nor receives. delay: answers late. fault: overload, without torque. freeze:
the motor is blocked, which ends in an overload. restart: the power fails for a moment."""

OnCycle = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""The plant: demanded positions (3,) [m, rad, rad] to positions; called once per period."""
_IDLE = 0.005
"""How often the line is looked at while no client has it open [s]."""


class SimulatedServos(SimulatedMotors[FaultKind]):
    """Three servos on one line.

    Args:
        config: The true rig; ``channel`` becomes a link to the pseudo-terminal.
        on_cycle: The plant; without it, the motors follow ideally.
        start: (3,) positions at power-on [m, rad, rad]; turns before it are unknown to the servos.

    Raises:
        ConfigError: The link cannot be made.
    """

    def __init__(
        self,
        config: DrivesConfig,
        on_cycle: OnCycle | None = None,
        *,
        start: NDArray[np.float64] | None = None,
    ) -> None:
        super().__init__(get_args(FaultKind))
        self._config = config
        self._on_cycle = on_cycle
        self._is_v2 = config.protocol == "dynamixel"
        self._codec = DynamixelPackets() if self._is_v2 else FeetechPackets()
        self._word = 2 if self._is_v2 else 1
        self._answers: list[tuple[float, int, bytes]] = []
        self._order = itertools.count()
        self.servos = [
            SimulatedServo(config[dof], dof.label, config.protocol, self._logger(dof))
            for dof in Dof
        ]
        for servo, position in zip(
            self.servos, np.zeros(3) if start is None else start, strict=True
        ):
            servo.shaft = servo.scale.to_counts(float(position))
            servo.restart(time.monotonic())
        self._events.clear()
        self._has_goals = False
        self._stepped_at = 0.0
        self._link = Path(config.channel)
        self._line = self._open()
        self._buffer = bytearray()

    def __exit__(self, *failure: object) -> None:
        try:
            super().__exit__(*failure)
        finally:
            self._link.unlink(missing_ok=True)
            os.close(self._line)
            os.close(self._lock)

    def _open(self) -> int:
        line, end = os.openpty()
        try:
            tty.setraw(end)
            # The lock ends with the process; a link of one that was killed stays.
            self._lock = os.open(f"{self._link}.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if self._link.is_symlink():
                self._link.unlink()
            self._link.symlink_to(os.ttyname(end))
        except OSError as error:
            os.close(line)
            allowed = f"a link that can be made ({error}); is another bench running?"
            raise ConfigError("drives.channel", str(self._link), allowed) from None
        finally:
            os.close(end)  # so that a client's exclusive lock ends with the client
        os.set_blocking(line, False)
        return line

    def _begin(self) -> None:
        self._stepped_at = time.monotonic()

    def _process_next(self) -> None:
        due = self._stepped_at + 1.5 * self._config.cycle
        if self._answers:
            due = min(due, self._answers[0][0])
        self._receive(max(0.0, due - time.monotonic()))
        now = time.monotonic()
        self._apply_requests(now)
        for packet in self._codec.split(self._buffer):
            for servo in self._listening():
                servo.hear(now)
            self._serve(packet, now)
        while self._answers and self._answers[0][0] <= time.monotonic():
            self._send(heapq.heappop(self._answers)[2])
        has_cycled = self._has_goals and not self._answers
        if has_cycled or now >= self._stepped_at + 1.5 * self._config.cycle:
            self._step(now, has_cycled=has_cycled)

    def _receive(self, timeout: float) -> None:
        readable, _, _ = select.select([self._line], [], [], timeout)
        if not readable:
            return
        try:
            self._buffer += os.read(self._line, 4096)
        except OSError:  # no client has the other end open
            self._buffer.clear()
            time.sleep(_IDLE)

    def _send(self, data: bytes) -> None:
        try:
            os.write(self._line, data)
        except OSError:
            return  # the client is gone

    def _step(self, now: float, *, has_cycled: bool) -> None:
        # Without a client's cycles the clock counts, and a late step does not move the grid.
        self._stepped_at = now if has_cycled else self._stepped_at + self._config.cycle
        if now - self._stepped_at > 1.0:
            self._stepped_at = now
        self._has_goals = False
        period = self._config.cycle
        demand = np.array([servo.advance(period, now) for servo in self.servos])
        actual = demand if self._on_cycle is None else self._on_cycle(demand)
        for servo, position in zip(self.servos, actual, strict=True):
            servo.move(float(position))

    def _listening(self) -> Iterator[SimulatedServo]:
        return (
            servo
            for dof, servo in zip(Dof, self.servos, strict=True)
            if "drop" not in self._faults[dof]
        )

    def _serve(self, packet: Packet, now: float) -> None:
        """Carry out one instruction; servos answer one after the other, as the line is one."""
        servos = [
            servo for servo in self._listening() if packet.servo in (servo.id, packets.BROADCAST)
        ]
        answers = packet.servo != packets.BROADCAST or packet.instruction == packets.SYNC_READ
        answers |= packet.instruction == packets.PING and self._is_v2
        if packet.instruction == packets.SYNC_READ:
            asked = packet.data[2 * self._word :]
            servos = sorted(
                (one for one in servos if one.id in asked), key=lambda one: asked.index(one.id)
            )
        at = now + self._wire_time(packet.size)
        for servo in servos:
            name, (error, data) = servo.id, (CHECKSUM, b"")  # a new id holds from the next packet
            if packet.is_intact:
                error, data = self._carry_out(servo, packet, now)
            elif not self._is_v2:
                continue
            if answers:
                raw = self._codec.status(name, error * self._is_v2 or servo.error, data)
                at += self._wire_time(len(raw))
                late = self._faults[Dof(self.servos.index(servo))].get("delay", 0.0)
                heapq.heappush(self._answers, (at + late, next(self._order), raw))

    def _wire_time(self, size: int) -> float:
        return 10 * size / self._config.bitrate

    def _carry_out(self, servo: SimulatedServo, packet: Packet, now: float) -> tuple[int, bytes]:
        """Carry out an instruction; error and data of the answer."""
        word, data = self._word, packet.data
        address, rest = _number(data[:word]), data[word:]
        match packet.instruction:
            case packets.PING:
                return 0, servo.read(0, 2) + servo.read(6, 1) if self._is_v2 else b""
            case packets.READ if len(rest) != word:
                return DATA_LENGTH, b""
            case packets.READ | packets.SYNC_READ:
                return 0, servo.read(address, _number(rest[:word]))
            case packets.WRITE:
                return servo.write(address, rest, now), b""
            case packets.REG_WRITE:
                servo.registered = (address, rest)
            case packets.ACTION if servo.registered is not None:
                servo.write(*servo.registered, now)
                servo.registered = None
            case packets.SYNC_WRITE:
                self._sync_write(servo, address, _number(rest[:word]), rest[word:], now)
            case packets.REBOOT if self._is_v2:
                servo.restart(now)
            case _:
                return INSTRUCTION, b""
        return 0, b""

    def _sync_write(
        self, servo: SimulatedServo, address: int, size: int, data: bytes, now: float
    ) -> None:
        for start in range(0, len(data), size + 1):
            if data[start] == servo.id:
                servo.write(address, data[start + 1 : start + 1 + size], now)
        self._has_goals |= address == servo.family.goal.address

    def _apply(self, kind: FaultKind, dof: Dof, now: float) -> None:
        servo = self.servos[dof]
        servo.is_blocked |= kind == "freeze"
        if kind == "fault":
            servo.fail(OVERLOAD, now)
        elif kind == "restart":
            servo.restart(now)

    def _recover(self, dof: Dof) -> None:
        self.servos[dof].is_blocked = False


def _number(data: bytes) -> int:
    return int.from_bytes(data, "little")
