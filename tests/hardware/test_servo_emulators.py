"""The simulated servos satisfy the clients of their makers: `dynamixel_sdk` and `scservo_sdk`.

Addresses are those of the makers' manuals, written out here.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import dynamixel_sdk as dynamixel
import pytest
import rustypot
import scservo_sdk as feetech
from hypothesis import given
from hypothesis import strategies as st
from servo_settings import START, servos_config
from tautscope.bench.servo_packets import DynamixelPackets, FeetechPackets, crc16
from tautscope.bench.servos import SimulatedServos
from tautscope.dof import Dof
from waiting import until

OK = 0
PATIENCE = 300
"""Latency that the makers' clients allow for [ms]: theirs, 16, is short on a busy computer."""


@contextmanager
def line(protocol: str, folder: Path, sdk: Any) -> Iterator[tuple[SimulatedServos, Any, Any]]:
    """Simulated servos, and port and packet handler of a maker's client."""
    config = servos_config(protocol, folder)
    with (
        pytest.MonkeyPatch.context() as patch,
        SimulatedServos(config, start=START) as servos,
    ):
        patch.setattr(sdk.port_handler, "LATENCY_TIMER", PATIENCE)
        port = sdk.PortHandler(config.channel)
        assert port.openPort()
        assert port.setBaudRate(1_000_000)
        try:
            yield servos, port, sdk.PacketHandler(2.0 if sdk is dynamixel else 0)
        finally:
            port.closePort()


@pytest.fixture
def dxl(tmp_path: Path) -> Iterator[tuple[SimulatedServos, Any, Any]]:
    with line("dynamixel", tmp_path, dynamixel) as made:
        yield made


@pytest.fixture
def sts(tmp_path: Path) -> Iterator[tuple[SimulatedServos, Any, Any]]:
    with line("feetech", tmp_path, feetech) as made:
        yield made


Line = tuple[SimulatedServos, Any, Any]


def test_dynamixel_ping_read_and_write(dxl: Line) -> None:
    _, port, packets = dxl
    assert packets.ping(port, 2) == (1190, OK, 0)
    found, result = packets.broadcastPing(port)
    assert (sorted(found), result) == ([1, 2, 3], OK)
    assert packets.ping(port, 9)[1] == dynamixel.COMM_RX_TIMEOUT
    assert packets.write1ByteTxRx(port, 2, 11, 4) == (OK, 0)  # extended position
    assert packets.read1ByteTxRx(port, 2, 11) == (4, OK, 0)
    # (-0.5 rad + pi) 4096 / (2 pi)
    assert packets.read4ByteTxRx(port, 2, 132)[0] == round((-0.5 / 6.283185307 + 0.5) * 4096)
    assert packets.write4ByteTxRx(port, 2, 116, 9000) == (OK, 0)
    assert packets.write1ByteTxRx(port, 2, 64, 1) == (OK, 0)
    assert packets.write4ByteTxRx(port, 2, 116, 9000) == (OK, 0)
    until(lambda: packets.read4ByteTxRx(port, 2, 132)[0] == 9000)  # beyond one turn


@pytest.mark.parametrize(
    ("address", "size", "value", "error"),
    [
        (132, 4, 5, 7),  # read-only
        (11, 1, 99, 4),  # out of range
        (116, 4, 5000, 4),  # beyond one turn in position mode
        (11, 1, 4, 7),  # in EEPROM while the torque is on
    ],
)
def test_dynamixel_refuses_as_the_manual_says(
    dxl: Line, address: int, size: int, value: int, error: int
) -> None:
    _, port, packets = dxl
    if error == 7:
        assert packets.write1ByteTxRx(port, 1, 64, 1) == (OK, 0)
    data = list(value.to_bytes(size, "little"))
    assert packets.writeTxRx(port, 1, address, size, data) == (OK, error)


def test_dynamixel_sync_read_and_write_with_byte_stuffing(dxl: Line) -> None:
    servos, port, packets = dxl
    stuffed = 0x00FDFFFF  # its bytes are FF FF FD 00, as a header
    writer = dynamixel.GroupSyncWrite(port, packets, 112, 4)
    for servo in (1, 2, 3):
        assert writer.addParam(servo, list(stuffed.to_bytes(4, "little")))
    assert writer.txPacket() == OK
    reader = dynamixel.GroupSyncRead(port, packets, 112, 4)
    for servo in (3, 1, 2):
        reader.addParam(servo)
    assert reader.txRxPacket() == OK
    assert [reader.getData(servo, 112, 4) for servo in (1, 2, 3)] == [stuffed] * 3
    servos.inject("drop", Dof.ROTATION)
    until(lambda: reader.txRxPacket() != OK)
    assert not reader.isAvailable(2, 112, 4)


def test_dynamixel_checksum_watchdog_and_overload(dxl: Line) -> None:
    servos, port, packets = dxl
    port.writePort(bytes.fromhex("FFFFFD000103000119FF"))  # a ping whose CRC is wrong
    answer = bytearray()
    until(lambda: answer.extend(port.readPort(64)) or len(answer) >= 11)
    assert answer[7:9] == bytes([0x55, 3])
    packets.write1ByteTxRx(port, 1, 64, 1)
    packets.write1ByteTxRx(port, 1, 98, 1)  # 20 ms
    until(lambda: any(event.what == "bus watchdog" for event in servos.events))
    assert packets.read1ByteTxRx(port, 1, 98)[0] == 255
    assert packets.write4ByteTxRx(port, 1, 116, 2000) == (OK, 4)  # goals are read-only
    assert packets.write1ByteTxRx(port, 1, 98, 0) == (OK, 0)
    assert packets.write4ByteTxRx(port, 1, 116, 2000) == (OK, 0)

    servos.inject("freeze", Dof.INSERTION)
    until(lambda: servos.servos[0].is_blocked)
    packets.write4ByteTxRx(port, 1, 116, 4000)
    until(lambda: packets.read1ByteTxRx(port, 1, 70)[2] == 0x80)  # alert
    assert packets.read1ByteTxRx(port, 1, 70)[0] == 1 << 5
    assert packets.read1ByteTxRx(port, 1, 64)[0] == 0
    servos.clear(Dof.INSERTION)
    assert packets.reboot(port, 1) == (OK, 0)
    assert packets.read1ByteTxRx(port, 1, 70) == (0, OK, 0)


def test_feetech_ping_read_and_write(sts: Line) -> None:
    _, port, packets = sts
    assert packets.ping(port, 3) == (777, OK, 0)
    assert packets.ping(port, 9)[1] == feetech.COMM_RX_TIMEOUT
    # -(0.5 rad - 4 rad) 4096 / (2 pi)
    assert packets.read2ByteTxRx(port, 3, 56)[0] == round(3.5 / 6.283185307 * 4096)
    for address in (9, 11):
        assert packets.write2ByteTxRx(port, 3, address, 0) == (OK, 0)
    assert packets.write1ByteTxRx(port, 3, 18, 0x1C) == (OK, 0)
    goal = feetech.SCS_TOSCS(-300, 15)
    assert packets.write2ByteTxRx(port, 3, 42, goal) == (OK, 0)
    assert packets.write1ByteTxRx(port, 3, 40, 1) == (OK, 0)
    until(lambda: feetech.SCS_TOHOST(packets.read2ByteTxRx(port, 3, 56)[0], 15) == -300)


def test_feetech_sync_read_write_checksum_and_overload(sts: Line) -> None:
    servos, port, packets = sts
    writer = feetech.GroupSyncWrite(port, packets, 46, 2)
    for servo in (1, 2, 3):
        assert writer.addParam(servo, [servo, 255])
    writer.txPacket()
    reader = feetech.GroupSyncRead(port, packets, 46, 2)
    for servo in (1, 2, 3):
        reader.addParam(servo)
    assert reader.txRxPacket() == OK
    assert [reader.getData(servo, 46, 2) for servo in (1, 2, 3)] == [0xFF01, 0xFF02, 0xFF03]
    port.writePort(bytes.fromhex("FFFF01020100"))  # a ping whose checksum is wrong: no answer
    assert packets.read1ByteTxRx(port, 1, 5) == (1, OK, 0)
    servos.inject("fault", Dof.INSERTION)
    until(lambda: packets.read1ByteTxRx(port, 1, 65)[2] == 0x20)
    assert packets.read1ByteTxRx(port, 1, 40)[0] == 0


def test_stored_settings_of_a_locked_feetech_are_lost_with_its_power(sts: Line) -> None:
    servos, port, packets = sts
    for lock, kept in ((1, 250), (0, 7)):
        packets.write1ByteTxRx(port, 2, 55, lock)
        packets.write1ByteTxRx(port, 2, 7, 7)
        count = len(servos.events)
        servos.inject("restart", Dof.ROTATION)
        until(lambda count=count: any(e.what == "restart" for e in servos.events[count:]))
        assert packets.read1ByteTxRx(port, 2, 7)[0] == kept
        servos.clear(Dof.ROTATION)


def test_ids_are_set_as_the_documentation_says(tmp_path: Path) -> None:
    for protocol, controller in (
        ("dynamixel", rustypot.Xl330PyController),
        ("feetech", rustypot.Sts3215PyController),
    ):
        folder = tmp_path / protocol
        folder.mkdir()
        config = servos_config(protocol, folder)
        with SimulatedServos(config, start=START) as servos:
            bus = rustypot.Bus(config.channel, 1_000_000, 1.0, {})
            bus.change_id(controller.definition(), 1, 17)
            assert sorted(bus.scan(controller.definition(), range(1, 21))) == [2, 3, 17]
            bus.close()
            assert servos.servos[0].stored[7 if protocol == "dynamixel" else 5] == 17


def test_bytes_at_another_bit_rate_are_noise(dxl: Line) -> None:
    _, port, packets = dxl
    assert port.setBaudRate(57_600)
    assert packets.ping(port, 2)[1] == dynamixel.COMM_RX_TIMEOUT
    assert port.setBaudRate(1_000_000)
    assert packets.ping(port, 2)[1] == OK


def test_crc_is_that_of_the_manual() -> None:
    """The ping of the manual's page on protocol 2.0: FF FF FD 00 01 03 00 01 19 4E."""
    assert crc16(bytes.fromhex("FFFFFD0001030001")) == 0x4E19


@given(st.lists(st.tuples(st.integers(0, 252), st.binary(max_size=20)), max_size=5), st.data())
def test_packets_are_found_however_the_bytes_arrive(
    sent: list[tuple[int, bytes]], data: st.DataObject
) -> None:
    """An answer is a packet with the instruction 0x55, or with the error in its place."""
    for codec in (DynamixelPackets(), FeetechPackets()):
        raw = b"".join(codec.status(servo, 0x11, body) for servo, body in sent)
        buffer, found = bytearray(), []
        while raw:
            size = data.draw(st.integers(1, len(raw)))
            buffer += raw[:size]
            raw = raw[size:]
            found += codec.split(buffer)
        assert [packet.servo for packet in found] == [servo for servo, _ in sent]
        assert all(packet.is_intact for packet in found)
        assert [
            packet.data[-len(body) :] for packet, (_, body) in zip(found, sent, strict=True) if body
        ] == [body for _, body in sent if body]


@given(st.binary(max_size=200))
def test_noise_never_blocks_the_line(noise: bytes) -> None:
    for codec in (DynamixelPackets(), FeetechPackets()):
        buffer = bytearray(noise)
        codec.split(buffer)
        buffer += codec.status(5, 0, b"x") * 40  # a broken length swallows a few at most
        assert any(packet.servo == 5 and packet.is_intact for packet in codec.split(buffer))
