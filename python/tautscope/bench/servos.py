"""Simulated servos behind a pseudo-terminal, with fault injection.

with SimulatedServos(config, plant): ...  # a client opens drives.channel as a serial port
"""

from collections.abc import Iterator
from functools import partial
from typing import Any

from tautscope.bench import servo_packets as packets
from tautscope.bench.line_motors import LineMotors
from tautscope.bench.servo import CHECKSUM, DATA_LENGTH, INSTRUCTION, OVERLOAD, SimulatedServo
from tautscope.bench.servo_packets import DynamixelPackets, FeetechPackets, Packet
from tautscope.config import DrivesConfig
from tautscope.dof import Motor


class SimulatedServos(LineMotors):
    """Servos on one line; see `LineMotors`. Turns before the start are unknown to them.

    Their faults: drop: neither sends nor receives. delay: answers late. fault: overload, without
    torque. freeze: the motor is blocked, which ends in an overload. restart: the power fails for a
    moment. unplug: the adapter is gone, of all motors.
    """

    def __init__(self, config: DrivesConfig, *arguments: Any, **options: Any) -> None:
        super().__init__(config, *arguments, **options)
        self._is_v2 = config.protocol == "dynamixel"
        self._codec = DynamixelPackets() if self._is_v2 else FeetechPackets()
        self._word = 2 if self._is_v2 else 1
        self.servos = [
            SimulatedServo(config[dof], config.protocol, self._start[dof], partial(self._log, dof))
            for dof in config.all_motors
        ]
        self._events.clear()

    def _process(self, now: float) -> None:
        first = next(self._order)
        for packet in self._codec.split(self._buffer):
            # The client waits for the answer to the last packet, and would take another for it.
            self._queued = sorted(one for one in self._queued if one[1] < first)
            for servo in self._listening():
                servo.heard_at = now
            self._serve(packet, now)

    def _advance(self, period: float, now: float) -> list[int]:
        return [servo.advance(period, now) for servo in self.servos]

    def _move(self, shafts: list[int]) -> None:
        for servo, shaft in zip(self.servos, shafts, strict=True):
            servo.move(shaft)

    def _listening(self) -> Iterator[SimulatedServo]:
        return (
            servo
            for dof, servo in zip(self._config.all_motors, self.servos, strict=True)
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
        if packet.instruction == packets.SYNC_WRITE and servos and packet.is_intact:
            address = _number(packet.data[: self._word])
            if address == servos[0].family.goal.address:
                self._begin_cycle(now)
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
                faults = self._faults[self._config.all_motors[self.servos.index(servo)]]
                self._queue(at + faults.get("delay", 0.0), raw)

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

    def _apply(self, kind: str, dof: Motor, now: float) -> None:
        servo = self.servos[dof]
        servo.is_blocked |= kind == "freeze"
        if kind == "fault":
            servo.fail(OVERLOAD, now)
        elif kind == "restart":
            servo.restart(now)
        elif kind == "unplug":
            self._unplug()

    def _recover(self, dof: Motor) -> None:
        super()._recover(dof)
        self.servos[dof].is_blocked = False


def _number(data: bytes) -> int:
    return int.from_bytes(data, "little")
