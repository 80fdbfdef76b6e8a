"""CiA 402 drives on EtherCAT (CANopen over EtherCAT), through `pysoem`.

The same objects as on CAN. Each cycle carries controlword and target to every drive and statusword,
position and mode back. The watchdog of the drives' process data stands for the heartbeats.

Tested against a fake of `pysoem.Master` only: there is no EtherCAT slave in software. Drives are
synchronised by the arrival of the process data, not by distributed clocks.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import (
    BusError,
    EmergencyError,
    SettingRefusedError,
    SilentDriveError,
    StateError,
)
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode, State
from tautscope.hardware.link import NO_ANSWER, AbsentError, Answer, Feedback
from tautscope.hardware.object_dictionary import Entry

ABSENT = (0x0602_0000, 0x0609_0011)
"""SDO abort codes: object, sub-index does not exist."""
_COMMAND = struct.Struct("<Hi")


@dataclass(slots=True)
class _Slave:
    """What is known of one drive."""

    name: str
    device: Any
    said: Answer = NO_ANSWER
    enabled: bool = False


class EthercatLink:
    """Three drives on an EtherCAT line; a `tautscope.hardware.link.Link`.

    Args:
        config: `channel` is the network adapter, `node` the position on the line, from 1.
        pysoem: What to use in place of the library of that name.

    Raises:
        BusError: The library is missing, the adapter cannot be opened, or drives are missing.
    """

    def __init__(self, config: DrivesConfig, pysoem: Any = None) -> None:
        self._config = config
        self._soem = _library() if pysoem is None else pysoem
        self._master = self._soem.Master()
        self._age = self._answers = 0
        self._heard = time.monotonic()
        self._closed = False
        try:
            self._master.open(config.channel)
        except (ConnectionError, OSError) as error:
            raise BusError(
                "EtherCAT",
                f"{config.channel} cannot be opened: {error}",
                "Check drives.channel; raw sockets need root or CAP_NET_RAW",
            ) from error
        found = self._master.config_init()
        needed = max(config[dof].node for dof in Dof)
        if found < needed:
            self.close()
            raise BusError(
                "EtherCAT",
                f"{max(found, 0)} devices on {config.channel}, {needed} needed",
                "Check cables and supplies, and drives.*.node",
            )
        self._slaves = {
            dof: _Slave(
                f"{dof.label}, device {config[dof].node}",
                self._master.slaves[config[dof].node - 1],
            )
            for dof in Dof
        }

    def name(self, dof: Dof) -> str:
        """The drive as a person finds it."""
        return self._slaves[dof].name

    def read(self, dof: Dof, entry: Entry) -> int:
        """A value by SDO upload; see `tautscope.hardware.link.Link.read`."""
        device = self._slaves[dof].device
        data = self._request(dof, entry, lambda: device.sdo_read(entry.index, entry.subindex))
        return entry.decode(bytes(data))

    def write(self, dof: Dof, entry: Entry, value: int) -> None:
        """Set a value by SDO download; see `tautscope.hardware.link.Link.write`."""
        device = self._slaves[dof].device
        self._request(
            dof,
            f"{entry} = {value}",
            lambda: device.sdo_write(entry.index, entry.subindex, entry.encode(value)),
        )

    def prepare(self, modes: Mapping[Dof, Mode]) -> None:
        """Layout and watchdog of the process data."""
        for dof in Dof:
            target = (
                objects.INTERPOLATION_DATA
                if modes[dof] is Mode.INTERPOLATED_POSITION
                else objects.TARGET_POSITION
            )
            self._map(dof, 0x1C12, 0x1600, (objects.CONTROLWORD, target))
            answer = (objects.STATUSWORD, objects.POSITION, objects.MODE_DISPLAY)
            self._map(dof, 0x1C13, 0x1A00, answer)
            device = self._slaves[dof].device
            device.set_watchdog("processdata", self._config.heartbeat_timeout * 1e3)
        try:
            self._master.config_map()
        except self._soem.ConfigMapError as error:
            raise SettingRefusedError(
                "EtherCAT", f"the process data cannot be laid out: {error}", "See the drives' PDOs"
            ) from error
        self._reach(self._soem.SAFEOP_STATE, "safe-operational")

    def operational(self) -> None:
        """Bring the line to operational; process data flows from here on."""
        self._heard, self._age = time.monotonic(), 0
        targets = [self._slaves[dof].said.position for dof in Dof]
        self._exchange([cia402.DISABLE_VOLTAGE] * 3, targets)
        self._reach(self._soem.OP_STATE, "operational")

    def cycle(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        """See `tautscope.hardware.link.Link.cycle`.

        Raises:
            EmergencyError: A drive went from operation enabled to a fault.
            BusError: The adapter is gone.
        """
        said = self._exchange(controlwords, targets)
        for dof, slave in self._slaves.items():
            state = cia402.state_of(slave.said.statusword)
            if slave.enabled and state in (State.FAULT, State.FAULT_REACTION):
                slave.enabled = False
                code = self.read(dof, objects.ERROR_CODE)
                raise EmergencyError(
                    slave.name,
                    f"it went to {state}, error code 0x{code:04X}",
                    "Look the code up in the drive's manual; start again with reset_faults",
                )
            slave.enabled = state is State.OPERATION_ENABLED
        return said

    def halt(self, controlword: int, targets: Sequence[int]) -> list[Feedback]:
        """As `cycle` with one controlword for all, but nothing else stands in its way."""
        return self._exchange([controlword] * 3, targets)

    def abandon(self, dofs: Sequence[Dof]) -> None:
        """End the process data of all: the drives' watchdogs stop the motors."""
        try:
            self._master.state = self._soem.SAFEOP_STATE
            self._master.write_state()
        except Exception:  # whatever it is, more cannot be done
            return

    def close(self) -> None:
        """Bring the line to its initial state and release the adapter; may be called twice."""
        if self._closed:
            return
        self._closed = True
        try:
            self._master.state = self._soem.INIT_STATE
            self._master.write_state()
        finally:
            self._master.close()

    def _exchange(self, controlwords: Sequence[int], targets: Sequence[int]) -> list[Feedback]:
        for dof, slave in self._slaves.items():
            slave.device.output = _COMMAND.pack(controlwords[dof], targets[dof])
        try:
            self._master.send_processdata()
            counter = self._master.receive_processdata(round(self._config.reply_timeout * 1e6))
        except (ConnectionError, OSError) as error:
            raise BusError(
                "EtherCAT", f"it is gone: {error}", "Check the adapter and start again"
            ) from error
        now = time.monotonic()
        if counter < self._master.expected_wkc:
            self._age += 1
        else:
            self._age, self._heard = 0, now
            self._answers += 1
            for slave in self._slaves.values():
                slave.said = Answer.unpack(bytes(slave.device.input))
        return [
            Feedback(*slave.said, age=self._age, answers=self._answers, silence=now - self._heard)
            for slave in self._slaves.values()
        ]

    def _reach(self, state: int, name: str) -> None:
        """Ask for a state of the line and wait for it, with process data flowing."""
        self._master.state = state
        self._master.write_state()
        deadline = time.monotonic() + self._config.state_timeout
        while self._master.state_check(state, 2_000) != state:
            if time.monotonic() > deadline:
                self._master.read_state()
                behind = [
                    f"{slave.name} in 0x{slave.device.state:02X}, AL status "
                    f"0x{slave.device.al_status:04X}"
                    for slave in self._slaves.values()
                    if slave.device.state != state
                ]
                raise StateError(
                    "EtherCAT",
                    f"{name} is not reached: " + "; ".join(behind),
                    "Look the AL status code up (ETG.1020)",
                )
            self._master.send_processdata()
            self._master.receive_processdata(2_000)

    def _map(self, dof: Dof, assignment: int, mapping: int, entries: tuple[Entry, ...]) -> None:
        """Lay out one direction of the process data: off, change, on."""
        count = Entry(mapping, 0, "number of mapped objects", 1)
        pdos = Entry(assignment, 0, "number of assigned PDOs", 1)
        self.write(dof, pdos, 0)
        self.write(dof, count, 0)
        for place, entry in enumerate(entries, 1):
            self.write(dof, Entry(mapping, place, "mapped object", 4), entry.mapping)
        self.write(dof, count, len(entries))
        self.write(dof, Entry(assignment, 1, "assigned PDO", 2), mapping)
        self.write(dof, pdos, 1)
        found = self.read(dof, count)
        if found != len(entries):
            raise SettingRefusedError(
                self.name(dof),
                f"{count} was set to {len(entries)} and reads back {found}",
                "See the drive's manual for what its PDOs may carry",
            )

    def _request(self, dof: Dof, what: object, ask: Callable[[], Any]) -> Any:
        name = self.name(dof)
        try:
            return ask()
        except self._soem.SdoError as error:
            if error.abort_code in ABSENT:
                raise AbsentError(
                    name, f"it does not have {what}", "It may be another kind of drive"
                ) from None
            raise SettingRefusedError(
                name,
                f"it refused {what}: abort code 0x{error.abort_code:08X} ({error.desc})",
                "See its manual for what it takes, and in which state",
            ) from None
        except (self._soem.WkcError, self._soem.MailboxError, self._soem.PacketError) as error:
            raise SilentDriveError(
                name, f"no answer to a request for {what} ({error})", "Check its supply and cables"
            ) from None


def _library() -> Any:
    try:
        import pysoem  # noqa: PLC0415
    except ImportError as error:
        raise BusError(
            "EtherCAT", f"pysoem is not installed ({error})", "pip install 'tautscope[ethercat]'"
        ) from None
    return pysoem
