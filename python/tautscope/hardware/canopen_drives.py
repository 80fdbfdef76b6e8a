"""CiA 402 drives on a CAN bus (CANopen, CiA 301).

`canopen` reads EDS files and speaks SDO; what is sent every cycle are plain frames:

    700+master  heartbeat, when due          from us
    200+node    controlword, when it changes; taken at once (transmission type 255)
    300+node    set-point; taken at SYNC (type 1)
    080         SYNC
    180+node    statusword, position, mode   from each drive, at SYNC (type 1)

There is no thread here. Whoever calls `cycle` keeps our heartbeat alive, so a loop that hangs is
noticed by the drives. An interface that hears its own frames cannot be used: they would be taken
for a second master's.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import can
from canopen import Network, ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import (
    BusError,
    ConfigError,
    DriveError,
    EmergencyError,
    HeartbeatError,
    SecondMasterError,
    SettingRefusedError,
    SilentDriveError,
    StateError,
)
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode
from tautscope.hardware.link import AbsentError, Feedback
from tautscope.hardware.object_dictionary import Entry, load_eds

NMT, SYNC, EMERGENCY = 0x000, 0x080, 0x080
ANSWER, CONTROLWORD, SET_POINT = 0x180, 0x200, 0x300
SDO_ANSWER, SDO_REQUEST, HEARTBEAT = 0x580, 0x600, 0x700
START, STOP, PRE_OPERATIONAL = 0x01, 0x02, 0x80
BOOT_UP, OPERATIONAL, PRE_OPERATIONAL_STATE = 0x00, 0x05, 0x7F
AT_ONCE, AT_EVERY_SYNC = 255, 1
INVALID = 1 << 31
"""In a PDO's COB-ID: the PDO does not exist."""
NO_REMOTE = 1 << 30
"""In a transmit PDO's COB-ID: not to be asked for with a remote frame."""
ABSENT = (0x0602_0000, 0x0609_0011)
"""SDO abort codes: object, sub-index does not exist."""
_ANSWER = struct.Struct("<Hib")


class _Sdo(SdoClient):
    """An SDO client whose answers arrive because it reads the bus itself."""

    RESPONSE_TIMEOUT = 0.0
    patience: float
    pump: Callable[[float], object]

    def read_response(self) -> bytes:
        deadline = time.monotonic() + self.patience
        while self.responses.empty() and (left := deadline - time.monotonic()) > 0:
            self.pump(left)
        response: bytes = super().read_response()  # type: ignore[no-untyped-call]
        return response


@dataclass(slots=True)
class _Node:
    """What is known of one drive."""

    name: str
    id: int
    dictionary: ObjectDictionary
    sdo: _Sdo
    statusword: int = 0
    position: int = 0
    mode: int = 0
    age: int = 0
    heard: float = 0.0
    beat: float = 0.0
    beating: int = PRE_OPERATIONAL_STATE
    was_operational: bool = False
    controlword: int | None = None
    emergency: bytes = b""


class CanopenLink:
    """Three drives on a CAN bus; a `tautscope.hardware.link.Link`.

    Args:
        config: Bus, nodes, times.
        bus: An open bus to use instead of the one the configuration names; closed with the link.

    Raises:
        ConfigError: An EDS file is missing or unreadable.
        BusError: The bus cannot be opened.
        SecondMasterError: There is traffic of another master.
    """

    def __init__(self, config: DrivesConfig, bus: can.BusABC | None = None) -> None:
        self._config = config
        self._nodes: dict[Dof, _Node] = {}
        dictionaries = {dof: _dictionary(config, dof) for dof in Dof}
        self._bus = _open(config) if bus is None else bus
        self._network = Network()
        self._network.bus = self._bus
        for dof, dictionary in dictionaries.items():
            node = config[dof].node
            sdo = _Sdo(SDO_REQUEST + node, SDO_ANSWER + node, dictionary)  # type: ignore[no-untyped-call]
            sdo.network, sdo.patience, sdo.pump = self._network, config.request_timeout, self._pump
            name = f"{dof.label}, node {node}"
            self._nodes[dof] = _Node(name, node, dictionary, sdo)
        self._by_id = {node.id: node for node in self._nodes.values()}
        self._foreign = self._foreign_frames()
        self._second_master: can.Message | None = None
        self._watching = False
        self._next_beat = 0.0
        try:
            self._listen(2 * config.heartbeat_period + 2 * config.cycle)
        except BaseException:
            self.close()
            raise

    def name(self, dof: Dof) -> str:
        """The drive as a person finds it."""
        return self._nodes[dof].name

    def read(self, dof: Dof, entry: Entry) -> int:
        """A value by SDO upload; see `tautscope.hardware.link.Link.read`."""
        data = self._request(dof, entry, lambda sdo: sdo.upload(entry.index, entry.subindex))
        return entry.decode(data)

    def write(self, dof: Dof, entry: Entry, value: int) -> None:
        """Set a value by SDO download; see `tautscope.hardware.link.Link.write`."""
        known = self._nodes[dof].dictionary.get_variable(entry.index, entry.subindex)
        size = len(known) // 8 if known is not None and known.fixed_size else entry.size
        try:
            data = value.to_bytes(size, "little", signed=entry.signed)
        except OverflowError:
            raise SettingRefusedError(
                self.name(dof), f"{entry} cannot hold {value}", "Check the drive's EDS file"
            ) from None
        what = f"{entry} = {value}"
        self._request(dof, what, lambda sdo: sdo.download(entry.index, entry.subindex, data))

    def prepare(self, modes: Mapping[Dof, Mode]) -> None:
        """Heartbeats both ways and the layout of the PDOs, read back."""
        config = self._config
        for dof in Dof:
            node = self._nodes[dof]
            self._nmt(PRE_OPERATIONAL, node.id)
            period = round(config.heartbeat_period * 1e3)
            timeout = round(config.heartbeat_timeout * 1e3)
            self._set(dof, objects.PRODUCER_HEARTBEAT, period)
            # Some drives refuse a consumer entry while the same producer is watched.
            self._set(dof, objects.CONSUMER_HEARTBEAT, 0)
            self._set(dof, objects.CONSUMER_HEARTBEAT, config.master_node << 16 | timeout)
            target = (
                objects.INTERPOLATION_DATA
                if modes[dof] is Mode.INTERPOLATED_POSITION
                else objects.TARGET_POSITION
            )
            answer = (objects.STATUSWORD, objects.POSITION, objects.MODE_DISPLAY)
            self._map(dof, 0x1400, CONTROLWORD, AT_ONCE, (objects.CONTROLWORD,))
            self._map(dof, 0x1401, SET_POINT, AT_EVERY_SYNC, (target,))
            self._map(dof, 0x1800, ANSWER, AT_EVERY_SYNC, answer)
            for base in (0x1402, 0x1403, 0x1801, 0x1802, 0x1803):
                self._silence(dof, base)

    def operational(self) -> None:
        """Start the nodes (NMT) and watch their heartbeats from now on."""
        self._drain()  # what they said of a run before is not of this one
        now = time.monotonic()
        for node in self._nodes.values():
            node.beat = node.heard = now
            node.beating, node.was_operational = PRE_OPERATIONAL_STATE, False
            node.statusword, node.controlword, node.age, node.emergency = 0, None, 0, b""
            self._nmt(START, node.id)
        self._watching = True

    def cycle(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        """See the module's text for the frames, `tautscope.hardware.link.Link.cycle` for the rest.

        Raises:
            EmergencyError: A drive sent an emergency.
            HeartbeatError: A drive's heartbeat stayed away.
            StateError: A drive was restarted.
            SecondMasterError: Another master's frames were heard.
            BusError: The bus is gone.
        """
        self._alarm()  # what came since the last cycle
        said = self._exchange(controlwords, targets)
        self._alarm()
        return said

    def quick_stop(self, targets: Sequence[int]) -> list[Feedback]:
        """As `cycle` with a quick stop for all, but nothing else stands in its way."""
        for node in self._nodes.values():
            node.controlword = None  # sent again every time, until it is confirmed
        return self._exchange([cia402.QUICK_STOP] * 3, targets)

    def abandon(self, dofs: Sequence[Dof]) -> None:
        """Stop these nodes (NMT); with our heartbeat gone, they quick-stop by themselves."""
        self._watching = False
        with suppress(DriveError):  # there may be no bus to say it on
            for dof in dofs:
                self._nmt(STOP, self._nodes[dof].id)

    def close(self) -> None:
        """Tell stopped drives not to wait for our heartbeat any more, and release the bus."""
        if self._network.bus is None:
            return
        if self._watching:
            self._watching = False
            for dof in Dof:
                try:
                    self.write(dof, objects.CONSUMER_HEARTBEAT, 0)
                except (DriveError, AbsentError):
                    break  # the one that is gone needs no telling, and the others may be slow
        self._network.bus = None
        with suppress(can.CanError, OSError):  # it may be unplugged
            self._bus.shutdown()

    # Frames

    def _exchange(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        self._drain()
        now = time.monotonic()
        if now >= self._next_beat:
            self._send(HEARTBEAT + self._config.master_node, bytes([OPERATIONAL]))
            self._next_beat = now + self._config.heartbeat_period - self._config.cycle / 2
        for dof, node in self._nodes.items():
            if node.controlword != controlwords[dof]:
                self._send(CONTROLWORD + node.id, struct.pack("<H", controlwords[dof]))
                node.controlword = controlwords[dof]
        for dof, node in self._nodes.items():
            self._send(SET_POINT + node.id, struct.pack("<i", targets[dof]))
        for node in self._nodes.values():
            node.age += 1
        self._send(SYNC, b"")
        deadline = time.monotonic() + self._config.reply_timeout
        while any(node.age for node in self._nodes.values()):
            left = deadline - time.monotonic()
            if left <= 0 or not self._pump(left):
                break
        now = time.monotonic()
        return [
            Feedback(node.statusword, node.position, node.mode, node.age, now - node.heard)
            for node in self._nodes.values()
        ]

    def _send(self, identifier: int, data: bytes) -> None:
        message = can.Message(arbitration_id=identifier, data=data, is_extended_id=False)
        try:
            self._bus.send(message)
        except (can.CanError, OSError, ValueError) as error:
            raise _gone(error) from error

    def _nmt(self, command: int, node: int) -> None:
        self._send(NMT, bytes([command, node]))

    def _pump(self, patience: float) -> bool:
        """Take one frame, waiting at most `patience` [s]; whether there was one."""
        try:
            message = self._bus.recv(patience)
        except (can.CanError, OSError, ValueError) as error:
            raise _gone(error) from error
        if message is None:
            return False
        if message.is_error_frame or message.is_extended_id or message.is_remote_frame:
            return True
        self._take(message)
        return True

    def _drain(self) -> None:
        while self._pump(0.0):
            pass

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
        if function == ANSWER and len(data) >= _ANSWER.size:
            node.statusword, node.position, node.mode = _ANSWER.unpack_from(data)
            node.age, node.heard = 0, now
        elif function == SDO_ANSWER and len(data) == 8:
            node.sdo.responses.put(data)
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

    def _listen(self, duration: float) -> None:
        deadline = time.monotonic() + duration
        while (left := deadline - time.monotonic()) > 0:
            self._pump(left)
        self._alarm()

    def _alarm(self) -> None:
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
        for node in self._nodes.values():
            if node.emergency:
                data, node.emergency = node.emergency, b""
                raise EmergencyError(
                    node.name,
                    f"emergency 0x{int.from_bytes(data[:2], 'little'):04X}, error register "
                    f"0x{data[2]:02X}, maker's data {data[3:].hex()}",
                    "Look the code up in the drive's manual; start again with reset_faults",
                )
        if not self._watching:
            return
        now = time.monotonic()
        for node in self._nodes.values():
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

    # Requests

    def _request(self, dof: Dof, what: object, ask: Callable[[_Sdo], bytes | None]) -> bytes:
        node = self._nodes[dof]
        try:
            data = ask(node.sdo)
        except SdoAbortedError as error:
            if error.code in ABSENT:
                raise AbsentError(str(what)) from None
            raise SettingRefusedError(
                node.name,
                f"it refused {what}: abort code 0x{error.code:08X} ({error})",
                "See its manual for what it takes, and in which state",
            ) from None
        except SdoCommunicationError as error:
            raise SilentDriveError(
                node.name,
                f"no answer to a request for {what} ({error})",
                f"Check drives.{dof.label}.node, its supply, the bus and the bit rate",
            ) from None
        except (can.CanError, OSError, RuntimeError) as error:
            raise _gone(error) from error
        return data if data is not None else b""

    def _set(self, dof: Dof, entry: Entry, value: int) -> None:
        try:
            self.write(dof, entry, value)
            found = self.read(dof, entry)
        except AbsentError:
            raise SettingRefusedError(
                self.name(dof), f"it does not have {entry}", "Such a drive cannot be used safely"
            ) from None
        if found != value:
            raise SettingRefusedError(
                self.name(dof),
                f"{entry} was set to 0x{value:X} and reads back 0x{found:X}",
                "See its manual for the values it takes, and when",
            )

    def _map(self, dof: Dof, base: int, cob: int, kind: int, entries: tuple[Entry, ...]) -> None:
        """Lay out a PDO in the order CiA 301 asks for: off, change, on."""
        name = f"PDO 0x{base:04X}"
        identifier, transmission, count, *mapped = objects.pdo_entries(base, base + 0x200, 0, name)
        valid = cob + self._nodes[dof].id
        if base >= 0x1800:
            valid |= self.read(dof, identifier) & NO_REMOTE
        self.write(dof, identifier, valid | INVALID)
        self._set(dof, transmission, kind)
        self.write(dof, count, 0)
        for place, entry in zip(mapped, entries, strict=False):
            self._set(dof, place, entry.mapping)
        self._set(dof, count, len(entries))
        self._set(dof, identifier, valid)

    def _silence(self, dof: Dof, base: int) -> None:
        """Switch off a PDO that is not used, if the drive has it."""
        identifier = objects.pdo_entries(base, base + 0x200, 0, f"PDO 0x{base:04X}")[0]
        try:
            value = self.read(dof, identifier)
            if not value & INVALID:
                self.write(dof, identifier, value | INVALID)
        except AbsentError:
            pass


def _open(config: DrivesConfig) -> can.BusABC:
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


def _dictionary(config: DrivesConfig, dof: Dof) -> ObjectDictionary:
    axis = config[dof]
    try:
        return load_eds(axis.eds or "", axis.node)
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"drives.{dof.label}.eds", axis.eds, f"a readable EDS file ({error})"
        ) from None


def _gone(error: BaseException) -> BusError:
    return BusError("CAN bus", f"it is gone: {error}", "Plug the adapter in and start again")
