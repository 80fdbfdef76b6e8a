"""The EtherCAT fieldbus with a fake of `pysoem` and simulated drives.

`Drives` runs on another fieldbus with the drives of the CAN bench: SDO by mailbox, process data as
PDO 0x1600 and 0x1A00.
"""

import struct
import tempfile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from drive_settings import AXES, drives_config
from tautscope.bench.drives import SimulatedDrive
from tautscope.config import Config, DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import (
    BusError,
    EmergencyError,
    ModeRefusedError,
    SecondMasterError,
    SettingRefusedError,
    SilentDriveError,
    StateError,
    may_move,
)
from tautscope.hardware import drives as drives_module
from tautscope.hardware import serial_numbers as serial_numbers_module
from tautscope.hardware.cia402 import STOPPED_STATES, Mode, State
from tautscope.hardware.cia402_drives import Cia402Drives
from tautscope.hardware.doctor import drives as doctor_module
from tautscope.hardware.doctor.drives import check_drives
from tautscope.hardware.drives import Drives, open_drives
from tautscope.hardware.ethercat_fieldbus import EthercatFieldbus
from tautscope.hardware.rig_lock import RigLock
from tautscope.hardware.serial_numbers import read_serial_numbers

INIT, PREOP, SAFEOP, OP = 1, 2, 4, 8


class SdoError(Exception):
    def __init__(self, code: int) -> None:
        super().__init__()
        self.abort_code, self.desc = code, "refused"


class WkcError(Exception):
    pass


class Slave:
    """A simulated drive with the interface of a pysoem slave."""

    def __init__(self, dof: Dof, config: DrivesConfig, modes: frozenset[int]) -> None:
        self.drive = SimulatedDrive(
            dof,
            config,
            self._receive,
            lambda now, what: None,
            modes=modes,
            absent=frozenset({0x6007}),
        )
        self.answers: list[bytes] = []
        self.drive.boot(0.0)
        self.assigned: dict[tuple[int, int], int] = {}
        self.output = bytes(6)
        self.input = bytes(7)
        self.state = PREOP
        self.al_status = 0x001B
        self.watchdog: tuple[str, float] | None = None
        self.is_silent = False

    def _receive(self, identifier: int, data: bytes) -> None:
        if identifier >> 7 == 0x580 >> 7:
            self.answers.append(data)

    def _ask(self, request: bytes) -> bytes:
        if self.is_silent:
            raise WkcError
        if struct.unpack_from("<H", request, 1)[0] in (0x1600, 0x1A00):
            base = struct.unpack_from("<H", request, 1)[0] - 0x200
            self.drive.values[base, 1] |= 1 << 31  # there is no COB-ID on EtherCAT
        self.drive.receive(0x600 + self.drive.node, request, 0.0)
        answer = self.answers.pop()
        if answer[0] == 0x80:
            raise SdoError(struct.unpack_from("<I", answer, 4)[0])
        return answer

    def sdo_read(self, index: int, subindex: int) -> bytes:
        answer = self._ask(struct.pack("<BHB4x", 0x40, index, subindex))
        return answer[4 : 8 - (answer[0] >> 2 & 3)]

    def sdo_write(self, index: int, subindex: int, data: bytes) -> None:
        if index in (0x1C12, 0x1C13):
            self.assigned[index, subindex] = int.from_bytes(data, "little")
            return
        command = 0x23 | (4 - len(data)) << 2
        self._ask(struct.pack("<BHB", command, index, subindex) + data.ljust(4, b"\0"))

    def set_watchdog(self, kind: str, milliseconds: float) -> None:
        self.watchdog = (kind, milliseconds)

    def cycle(self) -> None:
        values = self.drive.values
        for mapping, data in ((0x1600, self.output), (0x1A00, None)):
            assert self.assigned[0x1C12 if data else 0x1C13, 1] == mapping
        start = 0
        for key in self.drive._mapped(0x1600):
            size = self.drive.entries[key].size
            value = self.drive.entries[key].decode(self.output[start : start + size])
            self.drive._store(key, value, 0.0)
            start += size
        self.drive.on_sync(0.0)
        self.drive.set_position(self.drive.demand)
        self.input = b"".join(
            self.drive.entries[key].encode(values[key]) for key in self.drive._mapped(0x1A00)
        )


class Master:
    """A line of slaves with the interface of pysoem's Master."""

    def __init__(self, slaves: list[Slave], *, stuck_in: int | None = None) -> None:
        self.slaves = slaves
        self.state = PREOP
        self.expected_wkc = 3 * len(slaves)
        self.open_on: str | None = None
        self.is_unplugged = False
        self._stuck_in = stuck_in

    def open(self, adapter: str) -> None:
        if adapter != "eth7":
            raise ConnectionError(f"could not open interface {adapter}")
        self.open_on = adapter

    def close(self) -> None:
        self.open_on = None

    def config_init(self) -> int:
        return len(self.slaves) or -1

    def config_map(self) -> int:
        return 39

    def write_state(self) -> None:
        for slave in self.slaves:
            slave.state = self.state if self._stuck_in is None else self._stuck_in

    def read_state(self) -> int:
        return min(slave.state for slave in self.slaves)

    def state_check(self, state: int, timeout: int) -> int:
        return self.read_state()

    def send_processdata(self) -> None:
        if self.is_unplugged:
            raise ConnectionError("adapter is lost")

    def receive_processdata(self, timeout: int) -> int:
        counter = 0
        for slave in self.slaves:
            if not slave.is_silent and slave.state >= SAFEOP:
                slave.cycle()
                counter += 3
        return counter


QUICK = {
    "protocol": "ethercat",
    "channel": "eth7",
    "cycle": 0.001,
    "reply_timeout": 5e-4,
    "heartbeat_period": 0.001,
    "heartbeat_timeout": 0.02,
    "state_timeout": 0.5,
}


def line(modes: tuple[int, ...] = (8,), **options: Any) -> tuple[Any, Master, DrivesConfig]:
    config = drives_config(**QUICK)
    master = Master([Slave(dof, config, frozenset(modes)) for dof in Dof], **options)
    soem = SimpleNamespace(
        Master=lambda: master,
        SAFEOP_STATE=SAFEOP,
        OP_STATE=OP,
        INIT_STATE=INIT,
        SdoError=SdoError,
        WkcError=WkcError,
        MailboxError=type("MailboxError", (Exception,), {}),
        PacketError=type("PacketError", (Exception,), {}),
        ConfigMapError=type("ConfigMapError", (Exception,), {}),
    )
    return soem, master, config


def states(master: Master) -> set[State]:
    return {slave.drive.status for slave in master.slaves}


@pytest.mark.parametrize("mode", [8, 7])
def test_motors_follow_and_stop(mode: int) -> None:
    soem, master, config = line((mode,))
    with Drives(config, Cia402Drives(config, EthercatFieldbus(config, soem))) as drives:
        assert {one.mode for one in drives.commissioned} == {Mode(mode)}
        assert {slave.watchdog for slave in master.slaves} == {("processdata", 20.0)}
        command = drives.start()
        for _ in range(10):
            command = command + np.array([1e-5, 0.01, -0.005])
            applied = drives.exchange(command)
        for _ in range(5):
            applied = drives.exchange(command)
        np.testing.assert_allclose(applied, command, atol=1e-4)
        assert states(master) == {State.OPERATION_ENABLED}
        drives.stop()
        assert states(master) == {State.QUICK_STOP_ACTIVE}
        drives.disable()
    assert states(master) == {State.SWITCH_ON_DISABLED}
    assert master.open_on is None
    assert master.state == INIT


class Slowing(SimulatedDrive):
    """A drive that slows down on a quick stop ramp, by 5 counts per cycle in each."""

    speed = speed_at_the_end = 0

    def on_sync(self, now: float) -> None:
        before = self.demand
        super().on_sync(now)
        if self.status is State.OPERATION_ENABLED:
            self.speed = self.demand - before
        elif self.status is State.QUICK_STOP_ACTIVE:
            self.speed -= min(max(self.speed, -5), 5)
            self.demand += self.speed

    def _enter(self, target: State, now: float) -> None:
        if target is State.SWITCH_ON_DISABLED:
            self.speed_at_the_end = self.speed
        super()._enter(target, now)


def test_voltage_stays_until_the_motors_have_slowed_down(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(globals(), "SimulatedDrive", Slowing)
    soem, master, config = line()
    with running(soem, config) as drives:
        for _ in range(10):
            drives.exchange(drives.last_command + np.array([0.0, 0.01, 0.0]))
        rotation = master.slaves[Dof.ROTATION].drive
        assert rotation.speed == -100
        drives.disable()
        assert states(master) == {State.SWITCH_ON_DISABLED}
        assert rotation.speed_at_the_end == 0


def running(soem: Any, config: DrivesConfig) -> Drives:
    drives = Drives(config, Cia402Drives(config, EthercatFieldbus(config, soem)))
    drives.start()
    return drives


def test_fault_stops_all_drives() -> None:
    soem, master, config = line()
    with running(soem, config) as drives:
        master.slaves[1].drive.fail(0.0)
        with pytest.raises(EmergencyError, match=r"rotation, device 2.*0x4310"):
            drives.exchange(drives.last_command)
        assert states(master) <= STOPPED_STATES


def test_the_others_are_stopped_before_the_error_code_is_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    soem, master, config = line()
    with running(soem, config) as drives:
        first, second = (slave.drive for slave in master.slaves[:2])
        second.fail(0.0)
        read, found = Slave.sdo_read, list[State]()

        def sdo_read(slave: Slave, index: int, subindex: int) -> bytes:
            found.append(first.status)
            return read(slave, index, subindex)

        monkeypatch.setattr(Slave, "sdo_read", sdo_read)
        with pytest.raises(EmergencyError):
            drives.exchange(drives.last_command)
        assert found == [State.QUICK_STOP_ACTIVE]


def test_a_fault_is_told_though_its_code_cannot_be_read(monkeypatch: pytest.MonkeyPatch) -> None:
    soem, master, config = line()

    def sdo_read(slave: Slave, index: int, subindex: int) -> bytes:
        raise WkcError

    with running(soem, config) as drives:
        master.slaves[1].drive.fail(0.0)
        monkeypatch.setattr(Slave, "sdo_read", sdo_read)
        with pytest.raises(EmergencyError, match=r"rotation, device 2.*error code not read"):
            drives.exchange(drives.last_command)


def test_the_adapter_is_released_if_the_line_cannot_be_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(master: Master) -> int:
        raise ConnectionError

    monkeypatch.setattr(Master, "config_init", fail)
    soem, master, config = line()
    with pytest.raises(ConnectionError):
        EthercatFieldbus(config, soem)
    assert master.open_on is None


def test_an_adapter_that_is_lost_while_a_state_is_awaited_is_named() -> None:
    soem, master, config = line(stuck_in=PREOP)
    fieldbus = EthercatFieldbus(config, soem)
    master.is_unplugged = True
    with pytest.raises(BusError, match="EtherCAT: the connection is lost: adapter is lost"):
        Drives(config, Cia402Drives(config, fieldbus))


def test_a_stop_that_is_not_confirmed_is_told_though_the_adapter_fails(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def fail(master: Master) -> None:
        raise OSError("adapter is lost")

    soem, master, config = line()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    group = Cia402Drives(config, EthercatFieldbus(config, soem))
    drives = Drives(config, group, RigLock(config))
    drives.start()
    master.slaves[2].is_silent = True
    monkeypatch.setattr(Master, "close", fail)
    with pytest.raises(OSError, match="adapter is lost") as found:
        drives.close()
    assert may_move(found.value)
    with RigLock(config):
        pass


def test_doctor_leaves_drives_that_run_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    soem, master, config = line()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for module in (drives_module, doctor_module, serial_numbers_module):
        monkeypatch.setattr(
            module, "open_group", lambda of: Cia402Drives(of, EthercatFieldbus(of, soem))
        )
    with open_drives(config) as drives:
        start = drives.start()
        (finding,) = check_drives(config)
        assert (finding.status, "another program commands" in finding.found) == ("missing", True)
        with pytest.raises(SecondMasterError):
            read_serial_numbers(Config(drives=config))
        np.testing.assert_allclose(drives.exchange(start), start, atol=1e-4)
        assert states(master) == {State.OPERATION_ENABLED}
        assert {slave.state for slave in master.slaves} == {OP}
    assert {finding.status for finding in check_drives(config)} <= {"ok", "note"}


def test_faults_of_all_drives_are_reset_at_once() -> None:
    soem, master, config = line()
    with running(soem, config) as drives:
        for slave in master.slaves:
            slave.drive.fail(0.0)
        with pytest.raises(EmergencyError):
            drives.exchange(drives.last_command)
        drives.start(reset_faults=True)
        assert states(master) == {State.OPERATION_ENABLED}


def test_broken_line_stops_all_drives() -> None:
    soem, master, config = line()
    with running(soem, config) as drives:
        master.slaves[2].is_silent = True
        with pytest.raises(SilentDriveError) as found:
            for _ in range(10_000):
                drives.exchange(drives.last_command)
        assert "quick stop is not confirmed" in str(found.value.__notes__)
        assert master.state == SAFEOP  # the watchdogs stop the motors
        assert {slave.drive.status for slave in master.slaves[:2]} == {State.QUICK_STOP_ACTIVE}


def test_lost_adapter() -> None:
    soem, master, config = line()
    with running(soem, config) as drives:
        master.is_unplugged = True
        with pytest.raises(BusError, match="adapter is lost"):
            drives.exchange(drives.last_command)


def test_missing_adapter_and_devices() -> None:
    soem, master, config = line()
    with pytest.raises(BusError, match="CAP_NET_RAW"):
        EthercatFieldbus(drives_config(**QUICK | {"channel": "eth0"}), soem)
    master.slaves.pop()
    with pytest.raises(BusError, match="2 devices on eth7, 3 needed"):
        EthercatFieldbus(config, soem)
    assert master.open_on is None


def test_refused_settings_and_states() -> None:
    soem, master, config = line((1, 3))
    with pytest.raises(ModeRefusedError, match="neither"):
        Drives(config, Cia402Drives(config, EthercatFieldbus(config, soem)))
    assert master.open_on is None

    soem, master, config = line()
    for slave in master.slaves:
        del slave.drive.entries[0x607D, 1]
    with pytest.raises(SettingRefusedError, match="add 607D"):
        Drives(config, Cia402Drives(config, EthercatFieldbus(config, soem)))

    soem, master, _ = line()
    coarse = AXES["rotation"] | {"counts_per_unit": 2.7e8}
    config = drives_config(**QUICK, rotation=coarse)
    with pytest.raises(SettingRefusedError, match=r"cannot hold 5400000000 in 4.*add 607F"):
        Drives(config, Cia402Drives(config, EthercatFieldbus(config, soem)))

    soem, master, config = line()
    master.slaves[0].is_silent = True
    with pytest.raises(SilentDriveError, match="insertion, device 1"):
        Drives(config, Cia402Drives(config, EthercatFieldbus(config, soem)))

    soem, master, config = line(stuck_in=PREOP)
    with pytest.raises(StateError, match=r"safe-operational is not reached.*AL status 0x001B"):
        Drives(config, Cia402Drives(config, EthercatFieldbus(config, soem)))
