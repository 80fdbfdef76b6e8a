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
from tautscope.hardware import canopen_master as master
from tautscope.hardware import object_dictionary as objects
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

EVENT_DRIVEN, AT_EVERY_SYNC = 255, 1  # PDO transmission types
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

    def put(self, data: bytes) -> None:
        """Take a response; the library replaces the queue where it has old ones."""
        self.responses.put(data)

    def abort(self, abort_code: int = GENERAL_ERROR) -> None:
        """Send the abort without the library's log entry; the exception reports it."""
        self.send_request(struct.pack("<B3xI", 0x80, abort_code))  # type: ignore[no-untyped-call]


class CanopenFieldbus(master.CanopenMaster, Fieldbus):
    """Drives on the configured CAN bus, or on `bus`, which is closed with them; a `Fieldbus`.

    Raises:
        ConfigError: An EDS file is missing, unreadable or describes another drive.
        BusError: The bus cannot be opened.
        SecondMasterError: Another master sends frames.
    """

    def __init__(self, config: DrivesConfig, bus: can.BusABC | None = None) -> None:
        self._described = {dof: _description(config, dof) for dof in config.all_motors}
        super().__init__(config, master.open_bus(config) if bus is None else bus)
        self.names = [node.name for node in self.nodes.values()]
        self._network = Network()
        self._network.bus = self._bus
        self._sdo: list[_Sdo] = []
        for node in self.nodes.values():
            cobs = master.SDO_REQUEST + node.id, master.SDO_RESPONSE + node.id
            sdo = _Sdo(*cobs, ObjectDictionary())  # type: ignore[no-untyped-call]
            sdo.network, sdo.timeout = self._network, config.request_timeout
            sdo.receive_one, node.on_sdo_response = self.receive_one, sdo.put
            self._sdo.append(sdo)
        try:
            self.detect_second_master(2 * config.heartbeat_period + 2 * config.cycle)
            for dof in config.all_motors:
                self._check_identity(dof)
        except BaseException:
            self.close()
            raise

    def configure(self, modes: Mapping[Motor, Mode]) -> None:
        """Configure producer and consumer heartbeats and the PDOs, and read them back."""
        config = self._config
        for dof in self._config.all_motors:
            node = self.nodes[dof]
            self.send_nmt(master.PRE_OPERATIONAL, node.id)
            period = round(config.heartbeat_period * 1e3)
            timeout = round(config.heartbeat_timeout * 1e3)
            node.has_heartbeat = self._set_or_waive(dof, objects.PRODUCER_HEARTBEAT, period)
            # Some drives refuse a second consumer entry for the same producer.
            for value in (0, config.master_node << 16 | timeout):
                self._set_or_waive(dof, objects.CONSUMER_HEARTBEAT, value)
            self._map(dof, 0x1400, master.RX_PDO_1, EVENT_DRIVEN, (objects.CONTROLWORD,))
            self._map(dof, 0x1401, master.RX_PDO_2, AT_EVERY_SYNC, (target_object(modes[dof]),))
            self._map(dof, 0x1800, master.TX_PDO_1, AT_EVERY_SYNC, TX_PDO_OBJECTS)
            for base in (0x1402, 0x1403, 0x1801, 0x1802, 0x1803):
                self._disable_pdo(dof, base)

    def exchange(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        """See `Fieldbus.exchange`; raises also what `check` raises."""
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
                self.send_nmt(master.STOP, self.nodes[dof].id)

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

    def _size(self, dof: Motor, entry: Entry) -> int:
        number = self._described[dof].types.get((entry.index, entry.subindex), 0)
        return SIZES.get(number, entry.size)

    def _transfer(self, dof: Motor, entry: Entry, what: object, data: bytes | None = None) -> bytes:
        name, sdo = self.names[dof], self._sdo[dof]
        try:
            if data is None:
                return sdo.upload(entry.index, entry.subindex)
            sdo.download(entry.index, entry.subindex, data)
        except SdoAbortedError as error:
            raise abort_error(name, what, error.code, error) from None
        except SdoCommunicationError as error:
            raise SilentDriveError(
                name,
                f"no answer to an SDO request for {what} ({error})",
                f"Check {dof.key}.node, its supply, the bus and the bit rate",
            ) from None
        except (can.CanError, OSError, RuntimeError) as error:
            raise master.bus_lost(error) from error
        return b""

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
        identifier, transmission, count, *mapped = objects.pdo_entries(base)
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
        identifier = objects.pdo_entries(base)[0]
        with suppress(AbsentError):
            value = self.read(dof, identifier)
            if not value & INVALID:
                self.write(dof, identifier, value | INVALID)


def _description(config: DrivesConfig, dof: Motor) -> Described:
    axis = config[dof]
    try:
        return load_eds(axis.eds, axis.node)
    except (OSError, ValueError) as error:
        raise ConfigError(f"{dof.key}.eds", axis.eds, f"a readable EDS file ({error})") from None
