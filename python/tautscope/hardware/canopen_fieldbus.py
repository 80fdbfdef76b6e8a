"""CiA 402 drives on a CAN bus (CANopen, CiA 301).

SDO transfers go through the `canopen` library, process data through
`tautscope.hardware.canopen_master`.

There is no thread: `exchange` sends the master's heartbeat, so that the drives detect a control
loop that hangs. An interface that echoes its own frames cannot be used: the echo would look like a
second master.
"""

import struct
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress

import can
from canopen import Network, ObjectDictionary
from canopen.sdo.client import SdoClient
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from tautscope.config import DrivesConfig
from tautscope.dof import Motor
from tautscope.errors import ConfigError, DriveError, SettingRefusedError, SilentDriveError
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.canopen_master import (
    PRE_OPERATIONAL,
    RX_PDO_1,
    RX_PDO_2,
    SDO_REQUEST,
    SDO_RESPONSE,
    STOP,
    TX_PDO_1,
    CanopenMaster,
    bus_lost,
    open_bus,
)
from tautscope.hardware.cia402 import Mode
from tautscope.hardware.drive_group import Feedback
from tautscope.hardware.eds import Described, load_eds
from tautscope.hardware.fieldbus import (
    TX_PDO_OBJECTS,
    AbsentError,
    Fieldbus,
    abort_error,
    require_waived,
    target_object,
)
from tautscope.hardware.object_dictionary import SIZES, Entry

EVENT_DRIVEN, AT_EVERY_SYNC = 255, 1
"""PDO transmission types."""
INVALID = 1 << 31
"""Bit 31 of a PDO's COB-ID: the PDO is not valid."""
NO_RTR = 1 << 30
"""Bit 30 of a TxPDO's COB-ID: no remote transmission request allowed."""
GENERAL_ERROR = 0x0800_0000
"""SDO abort code."""


class _Sdo(SdoClient):
    """An SDO client that reads the bus itself while it waits for a response."""

    RESPONSE_TIMEOUT = 0.0
    timeout: float
    receive_one: Callable[[float], object]

    def read_response(self) -> bytes:
        deadline = time.monotonic() + self.timeout
        while self.responses.empty() and (left := deadline - time.monotonic()) > 0:
            self.receive_one(left)
        response: bytes = super().read_response()  # type: ignore[no-untyped-call]
        return response

    def abort(self, abort_code: int = GENERAL_ERROR) -> None:
        """Send the abort without the library's log entry; the exception reports it."""
        self.send_request(struct.pack("<B3xI", 0x80, abort_code))  # type: ignore[no-untyped-call]


class CanopenFieldbus(CanopenMaster, Fieldbus):
    """Drives on a CAN bus; a `Fieldbus`.

    Args:
        config: Bus, nodes, timeouts.
        bus: An open bus instead of the configured one; it is closed with this object.

    Raises:
        ConfigError: An EDS file is missing, unreadable or describes another drive.
        BusError: The bus cannot be opened.
        SecondMasterError: Another master sends frames.
    """

    def __init__(self, config: DrivesConfig, bus: can.BusABC | None = None) -> None:
        self._described = {dof: _description(config, dof) for dof in config.all_motors}
        super().__init__(config, open_bus(config) if bus is None else bus)
        self._network = Network()
        self._network.bus = self._bus
        self._sdo: dict[Motor, _Sdo] = {}
        for dof in config.all_motors:
            node = config[dof].node
            sdo = _Sdo(SDO_REQUEST + node, SDO_RESPONSE + node, ObjectDictionary())  # type: ignore[no-untyped-call]
            sdo.network, sdo.timeout = self._network, config.request_timeout
            sdo.receive_one = self.receive_one
            self._sdo[dof] = sdo
        try:
            self.detect_second_master(2 * config.heartbeat_period + 2 * config.cycle)
            for dof in config.all_motors:
                self._check_identity(dof)
        except BaseException:
            self.close()
            raise

    def name(self, dof: Motor) -> str:
        """See `Fieldbus.name`."""
        return self.nodes[dof].name

    def configure(self, modes: Mapping[Motor, Mode]) -> None:
        """Configure producer and consumer heartbeats and the PDOs, and read them back."""
        config = self._config
        for dof in self._config.all_motors:
            node = self.nodes[dof]
            self.send_nmt(PRE_OPERATIONAL, node.id)
            period = round(config.heartbeat_period * 1e3)
            timeout = round(config.heartbeat_timeout * 1e3)
            node.has_heartbeat = self._set_or_waive(dof, objects.PRODUCER_HEARTBEAT, period)
            # Some drives refuse a second consumer entry for the same producer.
            for value in (0, config.master_node << 16 | timeout):
                self._set_or_waive(dof, objects.CONSUMER_HEARTBEAT, value)
            self._map(dof, 0x1400, RX_PDO_1, EVENT_DRIVEN, (objects.CONTROLWORD,))
            self._map(dof, 0x1401, RX_PDO_2, AT_EVERY_SYNC, (target_object(modes[dof]),))
            self._map(dof, 0x1800, TX_PDO_1, AT_EVERY_SYNC, TX_PDO_OBJECTS)
            for base in (0x1402, 0x1403, 0x1801, 0x1802, 0x1803):
                self._disable_pdo(dof, base)

    def exchange(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        """See `Fieldbus.exchange`.

        Raises:
            EmergencyError: A drive sent an emergency object.
            HeartbeatError: A drive's heartbeat is missing.
            StateError: A drive restarted.
            SecondMasterError: Another master sends frames.
            BusError: The bus is lost.
        """
        self.receive_pending()
        self.check()  # frames since the last cycle
        feedback = self.cycle(controlwords, targets)
        self.check()
        return feedback

    def broadcast(self, controlword: int, targets: Sequence[int]) -> list[Feedback]:
        """See `Fieldbus.broadcast`."""
        for node in self.nodes.values():
            node.controlword = None  # send it in every cycle
        return self.cycle([controlword] * len(targets), targets)

    def stop_communication(self, dofs: Sequence[Motor]) -> None:
        """Stop these nodes (NMT); without the master's heartbeat they quick-stop by themselves."""
        self.is_monitoring = False
        with suppress(DriveError):  # the bus may be lost
            for dof in dofs:
                self.send_nmt(STOP, self.nodes[dof].id)

    def close(self) -> None:
        """Switch the drives' heartbeat consumers off and release the bus."""
        if self._network.bus is None:
            return
        if self.is_monitoring:
            self.is_monitoring = False
            for dof in self._config.all_motors:
                try:
                    with suppress(SettingRefusedError):  # it may lack the object
                        self.write(dof, objects.CONSUMER_HEARTBEAT, 0)
                except DriveError:
                    break  # the bus may be lost; do not wait for the other drives
        self._network.bus = None
        with suppress(can.CanError, OSError):  # the adapter may be unplugged
            self._bus.shutdown()

    def _on_sdo_response(self, node: int, data: bytes) -> None:
        for sdo in self._sdo.values():
            if sdo.tx_cobid == SDO_RESPONSE + node:
                sdo.responses.put(data)

    def _size(self, dof: Motor, entry: Entry) -> int:
        number = self._described[dof].types.get((entry.index, entry.subindex), 0)
        return SIZES.get(number, entry.size)

    def _upload(self, dof: Motor, entry: Entry) -> bytes:
        return self._request(dof, entry, lambda sdo: sdo.upload(entry.index, entry.subindex))

    def _download(self, dof: Motor, entry: Entry, data: bytes, what: str) -> None:
        self._request(dof, what, lambda sdo: sdo.download(entry.index, entry.subindex, data))

    def _request(self, dof: Motor, what: object, transfer: Callable[[_Sdo], bytes | None]) -> bytes:
        node = self.nodes[dof]
        try:
            data = transfer(self._sdo[dof])
        except SdoAbortedError as error:
            raise abort_error(node.name, what, error.code, error) from None
        except SdoCommunicationError as error:
            raise SilentDriveError(
                node.name,
                f"no answer to an SDO request for {what} ({error})",
                f"Check {dof.key}.node, its supply, the bus and the bit rate",
            ) from None
        except (can.CanError, OSError, RuntimeError) as error:
            raise bus_lost(error) from error
        return data if data is not None else b""

    def _set(self, dof: Motor, entry: Entry, value: int) -> None:
        self.write(dof, entry, value)
        self.verify(dof, entry, value)

    def _set_or_waive(self, dof: Motor, entry: Entry, value: int) -> bool:
        """Set a value and read it back; False if that fails and is waived."""
        try:
            self._set(dof, entry, value)
        except SettingRefusedError as error:
            require_waived(self._config, entry, error)
            return False
        return True

    def _map(
        self, dof: Motor, base: int, cob: int, transmission_type: int, entries: tuple[Entry, ...]
    ) -> None:
        """Configure a PDO in the order of CiA 301: invalidate, change, validate."""
        name = f"PDO 0x{base:04X}"
        identifier, transmission, count, *mapped = objects.pdo_entries(base, base + 0x200, 0, name)
        valid = cob + self.nodes[dof].id
        if base >= 0x1800:
            valid |= self.read(dof, identifier) & NO_RTR
        self.write(dof, identifier, valid | INVALID)
        self._set(dof, transmission, transmission_type)
        self.write(dof, count, 0)
        for slot, entry in zip(mapped, entries, strict=False):
            self._set(dof, slot, entry.mapping)
        self._set(dof, count, len(entries))
        self._set(dof, identifier, valid)

    def _check_identity(self, dof: Motor) -> None:
        """Check that the EDS file describes this drive."""
        described = self._described[dof]
        for entry, number in (
            (objects.VENDOR_ID, described.vendor),
            (objects.PRODUCT_CODE, described.product),
        ):
            if number and (found := self.read(dof, entry)) != number:
                raise ConfigError(
                    f"{dof.key}.eds",
                    self._config[dof].eds,
                    f"the EDS file of node {self._config[dof].node}, whose {entry} is "
                    f"0x{found:X}, not 0x{number:X}",
                )

    def _disable_pdo(self, dof: Motor, base: int) -> None:
        """Invalidate an unused PDO, if the drive has it."""
        identifier = objects.pdo_entries(base, base + 0x200, 0, f"PDO 0x{base:04X}")[0]
        try:
            value = self.read(dof, identifier)
            if not value & INVALID:
                self.write(dof, identifier, value | INVALID)
        except AbsentError:
            pass


def _description(config: DrivesConfig, dof: Motor) -> Described:
    axis = config[dof]
    try:
        return load_eds(axis.eds, axis.node)
    except (OSError, ValueError) as error:
        raise ConfigError(f"{dof.key}.eds", axis.eds, f"a readable EDS file ({error})") from None
