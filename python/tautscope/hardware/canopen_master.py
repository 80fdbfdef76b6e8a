"""A CANopen master (CiA 301): NMT, SYNC, PDOs and heartbeats, without a thread.

Each cycle exchanges these frames:

    700+master  heartbeat, when due
    200+node    controlword, when it changes; transmission type 255, effective at once
    300+node    set-point; type 1, effective at SYNC
    080         SYNC
    180+node    statusword, position, mode from each drive; type 1, sent at SYNC

Emergency objects (080+node), heartbeats (700+node) and frames that only another master sends are
checked as they are read.
"""

import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import can

from tautscope.config import DrivesConfig
from tautscope.errors import BusError, EmergencyError, HeartbeatError, SecondMasterError, StateError
from tautscope.hardware.cia402 import error_text
from tautscope.hardware.drive_group import RESET, Feedback
from tautscope.hardware.fieldbus import TX_PDO

NMT, SYNC, EMERGENCY = 0x000, 0x080, 0x080
TX_PDO_1, RX_PDO_1, RX_PDO_2 = 0x180, 0x200, 0x300
SDO_RESPONSE, SDO_REQUEST, HEARTBEAT = 0x580, 0x600, 0x700
START, STOP, PRE_OPERATIONAL = 0x01, 0x02, 0x80
BOOT_UP, OPERATIONAL, PRE_OPERATIONAL_STATE = 0x00, 0x05, 0x7F


@dataclass(slots=True)
class Node:
    """State of the communication with one drive.

    Attributes:
        heartbeat_at, nmt_state: Time [s, monotonic clock] and NMT state of its last heartbeat.
        was_operational: Whether a heartbeat has reported operational.
        has_heartbeat: Whether it sends heartbeats; else its answers alone are checked.
        controlword: The controlword sent last; None if it must be sent again.
        emergency: Its first emergency object that has not been reported.
        on_sdo_response: Called with each SDO response.
    """

    name: str
    id: int
    feedback: Feedback = field(default_factory=Feedback)
    heartbeat_at: float = 0.0
    nmt_state: int = PRE_OPERATIONAL_STATE
    was_operational: bool = False
    has_heartbeat: bool = True
    controlword: int | None = None
    emergency: bytes = b""
    on_sdo_response: Callable[[bytes], None] = lambda data: None


class CanopenMaster:
    """Exchanges frames with drives and checks their heartbeats and emergency objects."""

    def __init__(self, config: DrivesConfig, bus: can.BusABC) -> None:
        self._config = config
        self._bus = bus
        self.nodes = {
            dof: Node(f"{dof.label}, node {config[dof].node}", config[dof].node)
            for dof in config.all_motors
        }
        self._by_id = {node.id: node for node in self.nodes.values()}
        # What only another master sends: no bus echoes our own frames.
        self._master_identifiers = {NMT, SYNC, HEARTBEAT + config.master_node} | {
            base + node for base in (RX_PDO_1, RX_PDO_2) for node in self._by_id
        }
        self._second_master: can.Message | None = None
        self.is_monitoring = False
        self._next_heartbeat = 0.0

    def start(self) -> None:
        """Start the nodes (NMT) and monitor their heartbeats from now on."""
        self.receive_pending()  # discard frames of an earlier run
        now = time.monotonic()
        for node in self.nodes.values():
            node.heartbeat_at = node.feedback.answered_at = now
            node.nmt_state, node.was_operational = PRE_OPERATIONAL_STATE, False
            node.feedback.statusword = node.feedback.age = 0
            node.controlword, node.emergency = None, b""
            self.send_nmt(START, node.id)
        self.is_monitoring = True

    def cycle(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        """Run one cycle of frames; wait for the TxPDOs for `reply_timeout` at most."""
        self.receive_pending()
        now = time.monotonic()
        if now >= self._next_heartbeat:
            self.send(HEARTBEAT + self._config.master_node, bytes([OPERATIONAL]))
            self._next_heartbeat = now + self._config.heartbeat_period - self._config.cycle / 2
        for dof, node in self.nodes.items():
            if node.controlword != controlwords[dof]:
                self.send(RX_PDO_1 + node.id, struct.pack("<H", controlwords[dof]))
                node.controlword = controlwords[dof]
        for dof, node in self.nodes.items():
            self.send(RX_PDO_2 + node.id, struct.pack("<i", targets[dof]))
        for node in self.nodes.values():
            node.feedback.age += 1
        self.send(SYNC, b"")
        deadline = time.monotonic() + self._config.reply_timeout
        while any(node.feedback.age for node in self.nodes.values()):
            left = deadline - time.monotonic()
            if left <= 0 or not self.receive_one(left):
                break
        now = time.monotonic()
        return [
            replace(node.feedback, silence=now - node.feedback.answered_at)
            for node in self.nodes.values()
        ]

    def send(self, identifier: int, data: bytes) -> None:
        """Send a frame."""
        message = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
        try:
            # Without a timeout, SocketCAN fails at a full queue and a serial adapter may hang.
            self._bus.send(message, self._config.reply_timeout)
        except (can.CanError, OSError, ValueError) as error:
            raise bus_lost(error) from error

    def send_nmt(self, command: int, node: int) -> None:
        """Send an NMT command."""
        self.send(NMT, bytes([command, node]))

    def receive_one(self, timeout: float) -> bool:
        """Receive and handle one frame; False if none came within `timeout` [s]."""
        try:
            message = self._bus.recv(timeout)
        except (can.CanError, OSError, ValueError) as error:
            raise bus_lost(error) from error
        if message is None:
            return False
        if message.is_error_frame or message.is_extended_id or message.is_remote_frame:
            return True
        self._handle(message)
        return True

    def receive_pending(self) -> None:
        """Receive and handle waiting frames, at most 1000 so that a flooded bus cannot block."""
        for _ in range(1000):
            if not self.receive_one(0.0):
                return

    def _handle(self, message: can.Message) -> None:
        identifier, data = message.arbitration_id, bytes(message.data)
        if identifier in self._master_identifiers:
            self._second_master = message
            return
        node = self._by_id.get(identifier & 0x7F)
        if node is None:
            return
        function = identifier & 0x780
        now = time.monotonic()
        if function == TX_PDO_1 and len(data) >= TX_PDO.size:
            one = node.feedback
            one.statusword, one.position, one.mode = TX_PDO.unpack_from(data)
            one.age, one.answered_at, one.answers = 0, now, one.answers + 1
        elif function == SDO_RESPONSE and len(data) == 8:
            node.on_sdo_response(data)
        elif function == HEARTBEAT and data:
            node.heartbeat_at, node.nmt_state = now, data[0] & 0x7F
            node.was_operational |= node.nmt_state == OPERATIONAL
        elif function == EMERGENCY and len(data) == 8 and data[:2] != b"\0\0":
            node.emergency = node.emergency or data

    def detect_second_master(self, duration: float) -> None:
        """Listen for another master for `duration` [s] before anything is sent."""
        deadline = time.monotonic() + duration
        while (left := deadline - time.monotonic()) > 0:
            self.receive_one(left)
        self.check()

    def check(self) -> None:
        """Raise the error for a second master, an emergency object or a missing heartbeat."""
        if (message := self._second_master) is not None:
            self._second_master = None
            frame = f"{message.arbitration_id:03X}#{bytes(message.data).hex().upper()}"
            raise SecondMasterError(
                "CAN bus",
                f"another master sends {frame}",
                "End the other program, or use an interface that does not echo its own frames",
            )
        for node in self.nodes.values():
            if node.emergency:
                data, node.emergency = node.emergency, b""
                raise EmergencyError(
                    node.name,
                    f"emergency {error_text(int.from_bytes(data[:2], 'little'))}, error register "
                    f"0x{data[2]:02X}, manufacturer's data {data[3:].hex()}",
                    f"Look the code up in the drive's manual, then {RESET}",
                )
        if not self.is_monitoring:
            return
        now = time.monotonic()
        for node in self.nodes.values():
            has_restarted = node.was_operational and node.nmt_state != OPERATIONAL
            if has_restarted or node.nmt_state == BOOT_UP:
                raise StateError(
                    node.name,
                    f"its NMT state is 0x{node.nmt_state:02X}, not operational (0x05)",
                    "It restarted or was stopped: check its supply",
                )
            if node.has_heartbeat and now - node.heartbeat_at > self._config.heartbeat_timeout:
                raise HeartbeatError(
                    node.name,
                    f"no heartbeat for {(now - node.heartbeat_at) * 1e3:.0f} ms",
                    "Check its supply, the bus and its terminating resistors",
                )


def open_bus(config: DrivesConfig) -> can.BusABC:
    """Open the configured CAN bus.

    Raises:
        BusError: The bus cannot be opened.
    """
    options: dict[str, Any] = {"bitrate": config.bitrate, **config.options}
    try:
        return can.Bus(interface=config.interface, channel=config.channel, **options)
    except (can.CanError, OSError, ValueError, TypeError) as error:
        if config.interface == "tautscope":
            channel = config.channel
            hint = "Start `tautscope bench`, or check drives.channel"
            raise BusError("CAN bus", f"no rig answers on {channel}", hint) from error
        hint = (
            f"sudo ip link set {config.channel} up type can bitrate {config.bitrate}"
            if config.interface == "socketcan"
            else "Check drives.interface, drives.channel and drives.options"
        )
        raise BusError(
            "CAN bus", f"{config.interface} {config.channel} cannot be opened: {error}", hint
        ) from error


def bus_lost(error: BaseException) -> BusError:
    """The error for a bus that failed while it was open."""
    return BusError(
        "CAN bus", f"the connection is lost: {error}", "Plug the adapter in and start again"
    )
