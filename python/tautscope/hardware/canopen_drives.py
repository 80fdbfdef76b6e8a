"""CiA 402 drives on a CAN bus (CANopen, CiA 301).

`canopen` reads EDS files and speaks SDO; what is sent every cycle are plain frames, in
`tautscope.hardware.can_wire`.

There is no thread here. Whoever calls `cycle` keeps our heartbeat alive, so a loop that hangs is
noticed by the drives. An interface that hears its own frames cannot be used: they would be taken
for a second master's.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

import can
from canopen import Network, ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import (
    ConfigError,
    DriveError,
    SettingRefusedError,
    SilentDriveError,
)
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.can_wire import (
    ANSWER,
    CONTROLWORD,
    PRE_OPERATIONAL,
    SDO_ANSWER,
    SDO_REQUEST,
    SET_POINT,
    STOP,
    Wire,
    gone,
    open_bus,
)
from tautscope.hardware.cia402 import Mode
from tautscope.hardware.link import AbsentError, Feedback
from tautscope.hardware.object_dictionary import Entry, load_eds

AT_ONCE, AT_EVERY_SYNC = 255, 1
INVALID = 1 << 31
"""In a PDO's COB-ID: the PDO does not exist."""
NO_REMOTE = 1 << 30
"""In a transmit PDO's COB-ID: not to be asked for with a remote frame."""
GENERAL_ERROR = 0x0800_0000
"""SDO abort code."""
ABSENT = (0x0602_0000, 0x0609_0011)
"""SDO abort codes: object, sub-index does not exist."""


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

    def abort(self, abort_code: int = GENERAL_ERROR) -> None:
        """Tell the drive; we are told by the exception, not by a line in a log."""
        self.send_request(struct.pack("<B3xI", 0x80, abort_code))  # type: ignore[no-untyped-call]


class CanopenLink:
    """Three drives on a CAN bus; a `tautscope.hardware.link.Link`.

    Args:
        config: Bus, nodes, times.
        bus: An open bus to use instead of the one the configuration names; closed with the link.

    Raises:
        ConfigError: An EDS file is missing, unreadable or of another drive.
        BusError: The bus cannot be opened.
        SecondMasterError: There is traffic of another master.
    """

    def __init__(self, config: DrivesConfig, bus: can.BusABC | None = None) -> None:
        self._config = config
        dictionaries = {dof: _dictionary(config, dof) for dof in Dof}
        self._network = Network()
        self._network.bus = self._bus = open_bus(config) if bus is None else bus
        self._sdo: dict[Dof, _Sdo] = {}
        self._wire = Wire(config, self._bus, self._answered)
        for dof, dictionary in dictionaries.items():
            node = config[dof].node
            sdo = _Sdo(SDO_REQUEST + node, SDO_ANSWER + node, dictionary)  # type: ignore[no-untyped-call]
            sdo.network, sdo.patience = self._network, config.request_timeout
            sdo.pump = self._wire.pump
            self._sdo[dof] = sdo
        try:
            self._wire.listen(2 * config.heartbeat_period + 2 * config.cycle)
            for dof in Dof:
                self._check_identity(dof)
        except BaseException:
            self.close()
            raise

    def name(self, dof: Dof) -> str:
        """The drive as a person finds it."""
        return self._wire.nodes[dof].name

    def read(self, dof: Dof, entry: Entry) -> int:
        """A value by SDO upload; see `tautscope.hardware.link.Link.read`."""
        data = self._request(dof, entry, lambda sdo: sdo.upload(entry.index, entry.subindex))
        return entry.decode(data)

    def write(self, dof: Dof, entry: Entry, value: int) -> None:
        """Set a value by SDO download; see `tautscope.hardware.link.Link.write`."""
        known = self._sdo[dof].od.get_variable(entry.index, entry.subindex)
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
            node = self._wire.nodes[dof]
            self._wire.nmt(PRE_OPERATIONAL, node.id)
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
        self._wire.start()

    def cycle(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        """See the module's text for the frames, `tautscope.hardware.link.Link.cycle` for the rest.

        Raises:
            EmergencyError: A drive sent an emergency.
            HeartbeatError: A drive's heartbeat stayed away.
            StateError: A drive was restarted.
            SecondMasterError: Another master's frames were heard.
            BusError: The bus is gone.
        """
        self._wire.drain()
        self._wire.alarm()  # what came since the last cycle
        said = self._wire.exchange(controlwords, targets)
        self._wire.alarm()
        return said

    def halt(self, controlword: int, targets: Sequence[int]) -> list[Feedback]:
        """As `cycle` with one controlword for all, but nothing else stands in its way."""
        for node in self._wire.nodes.values():
            node.controlword = None  # sent again every time, until it is confirmed
        return self._wire.exchange([controlword] * 3, targets)

    def abandon(self, dofs: Sequence[Dof]) -> None:
        """Stop these nodes (NMT); with our heartbeat gone, they quick-stop by themselves."""
        self._wire.watching = False
        with suppress(DriveError):  # there may be no bus to say it on
            for dof in dofs:
                self._wire.nmt(STOP, self._wire.nodes[dof].id)

    def close(self) -> None:
        """Tell stopped drives not to wait for our heartbeat any more, and release the bus."""
        if self._network.bus is None:
            return
        if self._wire.watching:
            self._wire.watching = False
            for dof in Dof:
                try:
                    self.write(dof, objects.CONSUMER_HEARTBEAT, 0)
                except DriveError:
                    break  # the one that is gone needs no telling, and the others may be slow
        self._network.bus = None
        with suppress(can.CanError, OSError):  # it may be unplugged
            self._bus.shutdown()

    def _answered(self, node: int, data: bytes) -> None:
        for sdo in self._sdo.values():
            if sdo.tx_cobid == SDO_ANSWER + node:
                sdo.responses.put(data)

    def _request(self, dof: Dof, what: object, ask: Callable[[_Sdo], bytes | None]) -> bytes:
        node = self._wire.nodes[dof]
        try:
            data = ask(self._sdo[dof])
        except SdoAbortedError as error:
            if error.code in ABSENT:
                raise AbsentError(
                    node.name, f"it does not have {what}", "It may be another kind of drive"
                ) from None
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
            raise gone(error) from error
        return data if data is not None else b""

    def _set(self, dof: Dof, entry: Entry, value: int) -> None:
        self.write(dof, entry, value)
        found = self.read(dof, entry)
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
        valid = cob + self._wire.nodes[dof].id
        if base >= 0x1800:
            valid |= self.read(dof, identifier) & NO_REMOTE
        self.write(dof, identifier, valid | INVALID)
        self._set(dof, transmission, kind)
        self.write(dof, count, 0)
        for place, entry in zip(mapped, entries, strict=False):
            self._set(dof, place, entry.mapping)
        self._set(dof, count, len(entries))
        self._set(dof, identifier, valid)

    def _check_identity(self, dof: Dof) -> None:
        """Whether the drive is the one its EDS file describes."""
        described = self._sdo[dof].od.device_information
        for entry, number in (
            (objects.VENDOR, described.vendor_number),
            (objects.PRODUCT, described.product_number),
        ):
            if number and (found := self.read(dof, entry)) != number:
                raise ConfigError(
                    f"drives.{dof.label}.eds",
                    self._config[dof].eds,
                    f"the file of the drive at node {self._config[dof].node}, whose {entry} is "
                    f"0x{found:X}, not 0x{number:X}",
                )

    def _silence(self, dof: Dof, base: int) -> None:
        """Switch off a PDO that is not used, if the drive has it."""
        identifier = objects.pdo_entries(base, base + 0x200, 0, f"PDO 0x{base:04X}")[0]
        try:
            value = self.read(dof, identifier)
            if not value & INVALID:
                self.write(dof, identifier, value | INVALID)
        except AbsentError:
            pass


def _dictionary(config: DrivesConfig, dof: Dof) -> ObjectDictionary:
    axis = config[dof]
    try:
        return load_eds(axis.eds or "", axis.node)
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"drives.{dof.label}.eds", axis.eds, f"a readable EDS file ({error})"
        ) from None
