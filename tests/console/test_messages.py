"""Decoding of whatever a page may send, and records in shared memory: hazard G11."""

import contextlib
import json
import multiprocessing
import threading

import msgspec
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from tautscope.config import Config
from tautscope.console import messages as msg
from tautscope.console.messages import LARGEST_MESSAGE
from tautscope.console.shared import Channels, SharedMemory, Slots

NUMBERS = st.one_of(st.integers(), st.floats(), st.sampled_from([2**53, -1, 1e308]))
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.text(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4)
    ),
    max_leaves=8,
)
FIELDS = [
    "type", "lease", "sequence", "image", "axes", "is_holding", "name", "value", "dof", "text",
    "profile", "token", "client", "width", "point",
]  # fmt: skip
TYPES = ["hello", "stop", "take", "servo", "action", "setting", "profile", "drawn", "Received"]
NEARLY = st.fixed_dictionaries(
    {"type": st.sampled_from(TYPES)},
    optional=dict.fromkeys(FIELDS[1:], VALUES)
    | dict.fromkeys(("axes", "point"), st.lists(NUMBERS, max_size=4) | VALUES)
    | {"lease": NUMBERS, "sequence": NUMBERS},
)
MARK = {"type": "action", "name": "mark"} | dict.fromkeys(("lease", "sequence", "image"), 2**53 - 1)
CHANNELS = Channels(SharedMemory(multiprocessing.get_context("spawn"), Config()))
DECODERS = [msg.decode_hello, msg.decode_control, msg.decode_video]


def check(message: object) -> None:
    """A decoded command is within its ranges, whatever the text was."""
    if isinstance(message, msg.Command):
        for number in (message.lease, message.sequence, message.image):
            assert type(number) is int
            assert 0 <= number < 2**53
    if isinstance(message, msg.Servo):
        assert 1 <= len(message.axes) <= 8
        assert all(-1 <= axis <= 1 for axis in message.axes)
        assert type(message.is_holding) is bool
        assert message.point is None or all(0 <= pixel < 2**16 for pixel in message.point)
    if isinstance(message, msg.Setting):
        assert 0 <= message.value <= 1
        assert len(message.dof) <= 32
    if isinstance(message, msg.Action):
        assert not message.name.startswith("_")


@settings(max_examples=400, deadline=None)
@given(st.binary(max_size=200) | NEARLY.map(lambda found: json.dumps(found).encode()))
@example(b'{"type":"servo","lease":1,"sequence":1,"image":1,"axes":[1e999,0,0],"is_holding":true}')
@example(b'{"type":"servo","lease":1,"sequence":1,"image":1,"axes":[NaN,0,0],"is_holding":true}')
@example(
    b'{"type":"servo","lease":1,"sequence":1,"image":1,"axes":[0],"is_holding":true,"point":[1e999,0]}'
)
def test_any_bytes_are_a_message_within_its_ranges_or_refused(data: bytes) -> None:
    for decode in DECODERS:
        with contextlib.suppress(msgspec.MsgspecError, UnicodeError):
            check(decode(data))


@settings(deadline=None)
@given(st.lists(st.floats(-3, 3) | NUMBERS, max_size=10))
def test_one_to_eight_axes_are_from_minus_one_to_one(axes: list[float]) -> None:
    fields = {"type": "servo", "lease": 1, "sequence": 1, "image": 1, "is_holding": True}
    data = json.dumps({**fields, "axes": axes}).encode()
    if 1 <= len(axes) <= 8 and all(-1 <= axis <= 1 for axis in axes):
        assert list(msg.decode_control(data).axes) == axes
    else:
        with pytest.raises(msgspec.MsgspecError):
            msg.decode_control(data)


@pytest.mark.parametrize("depth", [1000, 100_000])
def test_nesting_ends_in_an_error(depth: int) -> None:
    with pytest.raises((msgspec.MsgspecError, RecursionError)):
        msg.decode_control(b"[" * depth)


def test_every_message_crosses_unchanged() -> None:
    for message in (
        msg.Stop(), msg.Take(), msg.Servo(1, 2, 3, (0.5, -1.0, 0.0), True),
        msg.Servo(1, 2, 3, (0.0,), True, (0.0, 575.5)),
        msg.Action(1, 2, 3, "mark", "here"), msg.Setting(1, 2, 3, "scale", 0.5, "bending"),
        msg.SetProfile(1, 2, 3, "paper"),
    ):  # fmt: skip
        assert msg.decode_control(msg.encode(message)) == message
        received = msg.Received(7, 1.5, message)
        assert msg.decode_inbound(msg.encode(received)) == received


@given(NEARLY.map(lambda found: json.dumps(found).encode()[:LARGEST_MESSAGE]))
@example(json.dumps(MARK | {"text": "\x00" * 200}).encode())
def test_every_message_fits_into_a_record(data: bytes) -> None:
    with contextlib.suppress(msgspec.MsgspecError, UnicodeError):
        received = msg.encode(msg.Received(2**53, 1e17 / 3, msg.decode_control(data)))
        for slots in (CHANNELS.servo, CHANNELS.stop, CHANNELS.inbound):
            assert len(received) <= slots.capacity


@given(st.lists(st.binary(max_size=16), min_size=1, max_size=20), st.integers(2, 5))
def test_a_reader_that_keeps_up_gets_every_record(records: list[bytes], count: int) -> None:
    memory = memoryview(bytearray(Slots.size(16, count)))
    writer, reader = Slots(memory, count), Slots(memory, count)
    for number, data in enumerate(records, 1):
        assert writer.write(data) == number
        assert reader.following() == (number, data)
        assert reader.following() is None
    assert Slots(memory, count).newest() == (len(records), records[-1])


@given(st.integers(1, 40), st.integers(2, 5))
def test_a_reader_that_is_late_gets_the_newest_and_a_gap(total: int, count: int) -> None:
    memory = memoryview(bytearray(Slots.size(8, count)))
    writer, reader = Slots(memory, count), Slots(memory, count)
    for number in range(total):
        writer.write(b"%d" % number)
    numbers = []
    while (found := reader.following()) is not None:
        assert found[1] == b"%d" % (found[0] - 1)
        numbers.append(found[0])
    assert numbers == sorted(set(numbers))
    assert numbers[-1] == total


def test_a_record_that_is_too_long_is_refused() -> None:
    slots = Slots(memoryview(bytearray(Slots.size(8, 2))), 2)
    with pytest.raises(ValueError, match="longer than 8"):
        slots.write(b"123456789")


def test_records_read_while_they_are_written_are_whole() -> None:
    memory = memoryview(bytearray(Slots.size(512, 2)))
    writer, reader = Slots(memory, 2), Slots(memory, 2)
    ending = threading.Event()

    def write() -> None:
        number = 0
        while not ending.is_set():
            number += 1
            writer.write(bytes([number % 256]) * (number % 512))

    thread = threading.Thread(target=write)
    thread.start()
    try:
        found, last = 0, 0
        while found < 50:
            if (record := reader.newest()) is None:
                continue
            number, data = record
            assert number > last
            assert data == bytes([number % 256]) * (number % 512)
            found, last = found + 1, number
    finally:
        ending.set()
        thread.join()


@given(st.integers(0, 7), st.binary(min_size=1, max_size=4))
def test_a_damaged_record_is_not_used(at: int, noise: bytes) -> None:
    memory = bytearray(Slots.size(8, 2))
    writer, reader = Slots(memoryview(memory), 2), Slots(memoryview(memory), 2)
    writer.write(b"abcdefgh")
    start = len(memory) // 2 + 16 + at
    before = bytes(memory)
    memory[start : start + len(noise)] = noise[: len(memory) - start]
    found = reader.newest()
    assert found == ((1, b"abcdefgh") if bytes(memory) == before else None)
