"""The CAN bus between processes, also as an interface of python-can."""

import socket
import time
from collections.abc import Callable
from pathlib import Path

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tautscope.bench.can_bus import Hub, LocalBus
from waiting import TIMEOUT

frames = st.builds(
    lambda extended, identifier, data: can.Message(
        arbitration_id=identifier & (0x1FFF_FFFF if extended else 0x7FF),
        is_extended_id=extended,
        data=data,
    ),
    st.booleans(),
    st.integers(0, 0x1FFF_FFFF),
    st.binary(max_size=8),
)


def test_all_other_stations_receive_all_frames_in_order(station: Callable[[], LocalBus]) -> None:
    one, two, three = station(), station(), station()
    settle(one, two, three)

    @settings(max_examples=20, deadline=None)
    @given(st.lists(frames, max_size=30))
    def check(messages: list[can.Message]) -> None:
        for message in messages:
            one.send(message)
        for other in (two, three):
            for message in messages:
                received = other.recv(TIMEOUT)
                assert received is not None
                assert received.equals(message, timestamp_delta=None, check_channel=False)
        assert one.recv(0.0) is None

    check()


def settle(*stations: LocalBus) -> None:
    """Wait until the hub has accepted all stations."""
    for number, sender in enumerate(stations):
        for other in stations:
            if other is sender:
                continue
            received = None
            deadline = time.monotonic() + TIMEOUT
            while received is None or received.arbitration_id != number:
                assert time.monotonic() < deadline
                sender.send(can.Message(arbitration_id=number, is_extended_id=False))
                received = other.recv(0.1)
    # A station's last frame: what it repeated above has arrived before.
    for number, station in enumerate(stations):
        station.send(can.Message(arbitration_id=0x7FF - number, is_extended_id=False))
    marks = {0x7FF - number for number in range(len(stations))}
    for number, station in enumerate(stations):
        ends = marks - {0x7FF - number}
        while ends:
            received = station.recv(TIMEOUT)
            assert received is not None
            ends.discard(received.arbitration_id)


def test_bus_is_an_interface_of_python_can(hub: Hub) -> None:
    with can.Bus(interface="tautscope", channel=str(hub.path), bitrate=1_000_000) as bus:
        assert isinstance(bus, LocalBus)
        assert bus.recv(0.0) is None


def test_bus_requires_a_hub(tmp_path: Path) -> None:
    with pytest.raises(can.CanInitializationError, match="no bus at"):
        LocalBus(str(tmp_path / "nothing"))


def test_closed_hub_disconnects_its_stations(hub: Hub, station: Callable[[], LocalBus]) -> None:
    bus = station()
    hub.close()
    with pytest.raises(can.CanOperationError, match="the bus is closed"):
        bus.recv(TIMEOUT)
    assert not hub.path.exists()


def test_only_the_socket_of_a_dead_hub_is_replaced(tmp_path: Path) -> None:
    path = tmp_path / "can"
    dead = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    dead.bind(str(path))
    dead.close()
    with Hub(path), pytest.raises(OSError, match="in use"):
        Hub(path)


def test_station_that_does_not_read_is_disconnected(
    hub: Hub, station: Callable[[], LocalBus]
) -> None:
    talker, sleeper = station(), station()
    settle(talker, sleeper)
    for count in range(200_000):
        talker.send(
            can.Message(arbitration_id=count & 0x7FF, is_extended_id=False, data=b"8 bytes!")
        )
    listener = station()
    with pytest.raises(can.CanOperationError):
        while True:
            sleeper.recv(TIMEOUT)
    settle(talker, listener)
