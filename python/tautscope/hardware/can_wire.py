"""Frames to and from drives on a CAN bus, cycle by cycle (CANopen, CiA 301).

    700+master  heartbeat, when due          from us
    200+node    controlword, when it changes; taken at once (transmission type 255)
    300+node    set-point; taken at SYNC (type 1)
    080         SYNC
    180+node    statusword, position, mode   from each drive, at SYNC (type 1)

A drive's emergencies (080+node) and heartbeats (700+node), and whatever only another master would
send, are noticed as they are read.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import can

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import (
    BusError,
    EmergencyError,
    HeartbeatError,
    SecondMasterError,
    StateError,
)
from tautscope.hardware.link import ANSWER_SIZE, NO_ANSWER, Answer, Feedback

NMT, SYNC, EMERGENCY = 0x000, 0x080, 0x080
ANSWER, CONTROLWORD, SET_POINT = 0x180, 0x200, 0x300
SDO_ANSWER, SDO_REQUEST, HEARTBEAT = 0x580, 0x600, 0x700
START, STOP, PRE_OPERATIONAL = 0x01, 0x02, 0x80
BOOT_UP, OPERATIONAL, PRE_OPERATIONAL_STATE = 0x00, 0x05, 0x7F


@dataclass(slots=True)
class Node:
    """What is known of one drive.

    Attributes:
        name: As a person finds it.
        id: Its node id.
        said: What it said last.
        age: Cycles since it said so.
        answers: How often it answered a SYNC.
        heard, beat: When it last answered, and when its heartbeat came [s].
        beating: The state its heartbeat said.
        was_operational: Whether it ever said operational.
        controlword: What was sent to it last.
        emergency: The first emergency that nobody was told of.
    """

    name: str
    id: int
    said: Answer = NO_ANSWER
    age: int = 0
    answers: int = 0
    heard: float = 0.0
    beat: float = 0.0
    beating: int = PRE_OPERATIONAL_STATE
    was_operational: bool = False
    controlword: int | None = None
    emergency: bytes = b""


class Wire:
    """The bus and what is known of the drives on it.

    Args:
        config: Nodes and times.
        bus: An open bus.
        answered: Takes node id and data of each answer to an SDO request.
    """

    def __init__(
        self, config: DrivesConfig, bus: can.BusABC, answered: Callable[[int, bytes], None]
    ) -> None:
        self._config = config
        self._bus = bus
        self._answered = answered
        self.nodes = {
            dof: Node(f"{dof.label}, node {config[dof].node}", config[dof].node) for dof in Dof
        }
        self._by_id = {node.id: node for node in self.nodes.values()}
        self._foreign = self._foreign_frames()
        self._second_master: can.Message | None = None
        self.watching = False
        self._next_beat = 0.0

    def start(self) -> None:
        """Start the nodes (NMT) and watch their heartbeats from now on."""
        self.drain()  # what they said of a run before is not of this one
        now = time.monotonic()
        for node in self.nodes.values():
            node.beat = node.heard = now
            node.beating, node.was_operational = PRE_OPERATIONAL_STATE, False
            node.said = node.said._replace(statusword=0)
            node.controlword, node.age, node.emergency = None, 0, b""
            self.nmt(START, node.id)
        self.watching = True

    def exchange(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        """One cycle, as the module's text has it; waits `reply_timeout` for answers at most."""
        self.drain()
        now = time.monotonic()
        if now >= self._next_beat:
            self.send(HEARTBEAT + self._config.master_node, bytes([OPERATIONAL]))
            self._next_beat = now + self._config.heartbeat_period - self._config.cycle / 2
        for dof, node in self.nodes.items():
            if node.controlword != controlwords[dof]:
                self.send(CONTROLWORD + node.id, struct.pack("<H", controlwords[dof]))
                node.controlword = controlwords[dof]
        for dof, node in self.nodes.items():
            self.send(SET_POINT + node.id, struct.pack("<i", targets[dof]))
        for node in self.nodes.values():
            node.age += 1
        self.send(SYNC, b"")
        deadline = time.monotonic() + self._config.reply_timeout
        while any(node.age for node in self.nodes.values()):
            left = deadline - time.monotonic()
            if left <= 0 or not self.pump(left):
                break
        now = time.monotonic()
        return [
            Feedback(*node.said, age=node.age, answers=node.answers, silence=now - node.heard)
            for node in self.nodes.values()
        ]

    def send(self, identifier: int, data: bytes) -> None:
        """Put a frame on the bus."""
        message = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
        try:
            self._bus.send(message)
        except (can.CanError, OSError, ValueError) as error:
            raise gone(error) from error

    def nmt(self, command: int, node: int) -> None:
        """Put a command of network management on the bus."""
        self.send(NMT, bytes([command, node]))

    def pump(self, patience: float) -> bool:
        """Take one frame, waiting at most `patience` [s], and say whether there was one."""
        try:
            message = self._bus.recv(patience)
        except (can.CanError, OSError, ValueError) as error:
            raise gone(error) from error
        if message is None:
            return False
        if message.is_error_frame or message.is_extended_id or message.is_remote_frame:
            return True
        self._take(message)
        return True

    def drain(self) -> None:
        """Take what has come, but not for ever from a station that never stops talking."""
        for _ in range(1000):
            if not self.pump(0.0):
                return

    def _take(self, message: can.Message) -> None:
        identifier, data = message.arbitration_id, bytes(message.data)
        if identifier in self._foreign:
            self._second_master = message
            return
        node = self._by_id.get(identifier & 0x7F)
        if node is None:
            return
        function = identifier & 0x780
        now = time.monotonic()
        if function == ANSWER and len(data) >= ANSWER_SIZE:
            node.said = Answer.unpack(data)
            node.age, node.heard = 0, now
            node.answers += 1
        elif function == SDO_ANSWER and len(data) == 8:
            self._answered(node.id, data)
        elif function == HEARTBEAT and data:
            node.beat, node.beating = now, data[0] & 0x7F
            node.was_operational |= node.beating == OPERATIONAL
        elif function == EMERGENCY and len(data) == 8 and data[:2] != b"\0\0":
            node.emergency = node.emergency or data

    def _foreign_frames(self) -> frozenset[int]:
        """Identifiers that only a master sends; we do not hear our own."""
        ids = self._by_id
        commands = {base + node for base in (CONTROLWORD, SET_POINT) for node in ids}
        return frozenset(commands | {NMT, SYNC, HEARTBEAT + self._config.master_node})

    def listen(self, duration: float) -> None:
        """Before anything is sent: whether somebody else is master [s]."""
        deadline = time.monotonic() + duration
        while (left := deadline - time.monotonic()) > 0:
            self.pump(left)
        self.alarm()

    def alarm(self) -> None:
        """Raise what the bus has said that must stop a run."""
        if (foreign := self._second_master) is not None:
            self._second_master = None
            frame = f"{foreign.arbitration_id:03X}#{bytes(foreign.data).hex().upper()}"
            raise SecondMasterError(
                "CAN bus",
                f"somebody else sends {frame}",
                "Let only one program command the drives; use no interface that hears its own "
                "frames",
            )
        for node in self.nodes.values():
            if node.emergency:
                data, node.emergency = node.emergency, b""
                raise EmergencyError(
                    node.name,
                    f"emergency 0x{int.from_bytes(data[:2], 'little'):04X}, error register "
                    f"0x{data[2]:02X}, maker's data {data[3:].hex()}",
                    "Look the code up in the drive's manual; start again with reset_faults",
                )
        if not self.watching:
            return
        now = time.monotonic()
        for node in self.nodes.values():
            restarted = node.was_operational and node.beating != OPERATIONAL
            if restarted or node.beating == BOOT_UP:
                raise StateError(
                    node.name,
                    f"its heartbeat says 0x{node.beating:02X}, not operational (0x05)",
                    "It restarted or was stopped: check its supply",
                )
            if now - node.beat > self._config.heartbeat_timeout:
                raise HeartbeatError(
                    node.name,
                    f"no heartbeat for {(now - node.beat) * 1e3:.0f} ms",
                    "Check its supply, the bus and its terminating resistors",
                )


def open_bus(config: DrivesConfig) -> can.BusABC:
    """The bus a configuration names.

    Raises:
        BusError: It cannot be opened.
    """
    options: dict[str, Any] = {"bitrate": config.bitrate, **config.options}
    try:
        return can.Bus(interface=config.interface, channel=config.channel, **options)
    except (can.CanError, OSError, ValueError, TypeError) as error:
        hint = (
            f"sudo ip link set {config.channel} up type can bitrate {config.bitrate}"
            if config.interface == "socketcan"
            else "Check drives.interface, drives.channel and drives.options"
        )
        raise BusError(
            "CAN bus", f"{config.interface} {config.channel} cannot be opened: {error}", hint
        ) from error


def gone(error: BaseException) -> BusError:
    """What a failed bus means."""
    return BusError("CAN bus", f"it is gone: {error}", "Plug the adapter in and start again")
