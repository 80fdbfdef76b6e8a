"""CiA 402 drives on EtherCAT (CANopen over EtherCAT), through `pysoem`.

The objects are those of CANopen. The process data are controlword and target position to each
drive, statusword, position and mode from each. The process data watchdog replaces the heartbeats.

Tested against a fake of `pysoem.Master` only. The drives are synchronised by the arrival of the
process data, not by distributed clocks.
"""

import struct
import time
from collections.abc import Mapping, Sequence
from typing import Any

from tautscope.config import DrivesConfig
from tautscope.dof import Motor
from tautscope.errors import (
    BusError,
    DriveError,
    EmergencyError,
    SettingRefusedError,
    SilentDriveError,
    StateError,
)
from tautscope.extras import require_extras
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode, State
from tautscope.hardware.drive_group import RESET, Feedback
from tautscope.hardware.fieldbus import TX_PDO, TX_PDO_OBJECTS, Fieldbus, abort_error, target_object
from tautscope.hardware.object_dictionary import Entry

_RX_PDO = struct.Struct("<Hi")


class EthercatFieldbus(Fieldbus):
    """Drives on an EtherCAT line; a `Fieldbus`.

    Args:
        config: `channel` is the network adapter, `node` the position on the line, from 1.
        pysoem: Replaces the library of that name in tests.

    Raises:
        MissingExtraError: The library is not installed.
        BusError: The adapter or a drive is missing.
    """

    def __init__(self, config: DrivesConfig, pysoem: Any = None) -> None:
        self._config = config
        if pysoem is None:
            require_extras("EtherCAT", ["ethercat"])
            import pysoem  # type: ignore[no-redef]  # noqa: PLC0415
        self._soem = pysoem
        self._master = self._soem.Master()
        self._age = self._answers = 0
        self._answered_at = time.monotonic()
        self._is_closed = False
        try:
            self._master.open(config.channel)
        except (ConnectionError, OSError) as error:
            raise BusError(
                "EtherCAT",
                f"{config.channel} cannot be opened: {error}",
                "Check drives.channel; raw sockets need root or CAP_NET_RAW",
            ) from error
        needed = max(config[dof].node for dof in config.all_motors)
        try:
            found = self._master.config_init()
            if found < needed:
                raise BusError(
                    "EtherCAT",
                    f"{max(found, 0)} devices on {config.channel}, {needed} needed",
                    "Check cables and supplies, and drives.*.node",
                )
        except BaseException:
            self.close()
            raise
        self.names = [f"{dof.label}, device {config[dof].node}" for dof in config.all_motors]
        self._devices = [self._master.slaves[config[dof].node - 1] for dof in config.all_motors]
        self._tx_pdos: list[tuple[int, ...]] = [(0, 0, 0)] * len(self._devices)
        self._were_enabled = [False] * len(self._devices)

    def configure(self, modes: Mapping[Motor, Mode]) -> None:
        """Configure the mapping and the watchdog of the process data."""
        for dof in self._config.all_motors:
            self._map(dof, 0x1C12, 0x1600, (objects.CONTROLWORD, target_object(modes[dof])))
            self._map(dof, 0x1C13, 0x1A00, TX_PDO_OBJECTS)
            watchdog = self._config.heartbeat_timeout * 1e3
            self._devices[dof].set_watchdog("processdata", watchdog)
        try:
            self._master.config_map()
        except self._soem.ConfigMapError as error:
            raise SettingRefusedError(
                "EtherCAT", f"the process data cannot be mapped: {error}", "Check the drives' PDOs"
            ) from error
        self._reach(self._soem.SAFEOP_STATE, "safe-operational")

    def start(self) -> None:
        """Bring the line to operational; process data flows from here on."""
        self._answered_at, self._age = time.monotonic(), 0
        self._were_enabled = [False] * len(self._devices)
        targets = [position for _, position, _ in self._tx_pdos]
        self._exchange([cia402.DISABLE_VOLTAGE] * len(targets), targets)
        self._reach(self._soem.OP_STATE, "operational")

    def exchange(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        """See `Fieldbus.exchange`; `EmergencyError` if an enabled drive went to a fault."""
        feedback = self._exchange(controlwords, targets)
        for dof in self._config.all_motors:
            state = cia402.state_of(feedback[dof].statusword)
            if self._were_enabled[dof] and state in (State.FAULT, State.FAULT_REACTION):
                # The mailbox may take most of a second, in which the others would move on.
                self.broadcast(cia402.QUICK_STOP, targets)
                try:
                    code = cia402.error_text(self.read(dof, objects.ERROR_CODE))
                except DriveError:
                    code = "not read: its mailbox does not answer"
                raise EmergencyError(
                    self.names[dof],
                    f"it went to {state}, error code {code}",
                    f"Look the code up in the drive's manual, then {RESET}",
                )
            self._were_enabled[dof] = state is State.OPERATION_ENABLED
        return feedback

    def broadcast(self, controlword: int, targets: Sequence[int]) -> list[Feedback]:
        """See `Fieldbus.broadcast`."""
        return self._exchange([controlword] * len(targets), targets)

    def stop_communication(self, dofs: Sequence[Motor]) -> None:
        """End the process data of all drives: their watchdogs stop the motors."""
        try:
            self._master.state = self._soem.SAFEOP_STATE
            self._master.write_state()
        except Exception:  # nothing else can be done on a lost line
            return

    def close(self) -> None:
        """Bring all slaves to Init and release the adapter; a second call does nothing."""
        if self._is_closed:
            return
        self._is_closed = True
        try:
            self._master.state = self._soem.INIT_STATE
            self._master.write_state()
        finally:
            self._master.close()

    def _exchange(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        for device, word, target in zip(self._devices, controlwords, targets, strict=True):
            device.output = _RX_PDO.pack(word, target)
        counter = self._cycle(round(self._config.reply_timeout * 1e6))
        now = time.monotonic()
        if counter < self._master.expected_wkc:
            self._age += 1
        else:
            self._age, self._answered_at = 0, now
            self._answers += 1
            self._tx_pdos = [TX_PDO.unpack_from(bytes(device.input)) for device in self._devices]
        times = self._age, self._answers, self._answered_at, now - self._answered_at
        return [Feedback(position, *times, word, mode) for word, position, mode in self._tx_pdos]

    def _reach(self, state: int, name: str) -> None:
        """Request a state of all slaves and wait for it while process data are exchanged."""
        self._master.state = state
        self._master.write_state()
        deadline = time.monotonic() + self._config.state_timeout
        while self._master.state_check(state, 2_000) != state:
            if time.monotonic() > deadline:
                self._master.read_state()
                behind = [
                    f"{at} in 0x{device.state:02X}, AL status 0x{device.al_status:04X}"
                    for at, device in zip(self.names, self._devices, strict=True)
                    if device.state != state
                ]
                raise StateError(
                    "EtherCAT",
                    f"{name} is not reached: " + "; ".join(behind),
                    "Look the AL status code up (ETG.1020)",
                )
            self._cycle(2_000)

    def _cycle(self, timeout: int) -> int:
        """Exchange the process data within a time [us]; the working counter."""
        try:
            self._master.send_processdata()
            counter: int = self._master.receive_processdata(timeout)
        except OSError as error:
            raise BusError(
                "EtherCAT", f"the connection is lost: {error}", "Check the adapter and start again"
            ) from error
        return counter

    def _map(self, dof: Motor, assignment: int, mapping: int, entries: tuple[Entry, ...]) -> None:
        """Map one direction of the process data: invalidate, change, validate."""
        count = Entry(mapping, 0, "number of mapped objects", 1)
        pdos = Entry(assignment, 0, "number of assigned PDOs", 1)
        self.write(dof, pdos, 0)
        self.write(dof, count, 0)
        for slot, entry in enumerate(entries, 1):
            self.write(dof, Entry(mapping, slot, "mapped object", 4), entry.mapping)
        self.write(dof, count, len(entries))
        self.write(dof, Entry(assignment, 1, "assigned PDO", 2), mapping)
        self.write(dof, pdos, 1)
        self.verify(dof, count, len(entries))

    def _transfer(self, dof: Motor, entry: Entry, what: object, data: bytes | None = None) -> bytes:
        name, device = self.names[dof], self._devices[dof]
        try:
            if data is None:
                return bytes(device.sdo_read(entry.index, entry.subindex))
            device.sdo_write(entry.index, entry.subindex, data)
        except self._soem.SdoError as error:
            raise abort_error(name, what, error.abort_code, error.desc) from None
        except (self._soem.WkcError, self._soem.MailboxError, self._soem.PacketError) as error:
            raise SilentDriveError(
                name,
                f"no answer to an SDO request for {what} ({error})",
                "Check its supply and cables",
            ) from None
        return b""
