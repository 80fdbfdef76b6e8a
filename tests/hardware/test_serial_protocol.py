"""The serial line protocol: the host's frames and simulated board against the header in C."""

import binascii
import ctypes
import random
import re
import struct
from collections.abc import Sequence
from pathlib import Path

import pytest
from common.paths import ROOT
from hypothesis import given
from hypothesis import strategies as st
from serial_settings import ARDUINO, compiled, run
from tautscope.bench.serial_board import SerialBoard
from tautscope.hardware.serial_line import frames
from tautscope.hardware.serial_line.frames import FAULTS, Limits, Refusal, Request, State

AXES = [Limits(-1000, 2000, 500), Limits(-(2**31), 2**31 - 1, 2**32 - 1), Limits(0, 255, 1)]
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror")
MESSAGES = st.binary(min_size=1, max_size=frames.LONGEST - 3)


class Header:
    """The header, compiled for this computer."""

    def __init__(self, library: Path) -> None:
        self.c = ctypes.CDLL(str(library))
        for name in ("encode", "decode", "state"):
            getattr(self.c, name).restype = ctypes.c_uint8

    def array(self, name: str, kind: type[ctypes.c_int32] | type[ctypes.c_uint8]) -> list[int]:
        return list((kind * len(AXES)).in_dll(self.c, name))

    def put(
        self, name: str, kind: type[ctypes.c_int32] | type[ctypes.c_uint8], at: int, value: int
    ) -> None:
        (kind * len(AXES)).in_dll(self.c, name)[at] = value

    def encode(self, message: bytes) -> bytes:
        checked = message + binascii.crc_hqx(message, 0xFFFF).to_bytes(2, "little")
        frame = ctypes.create_string_buffer(300)
        size = self.c.encode(checked, len(checked), frame)
        return frame.raw[:size]

    def decode(self, frame: bytes) -> bytes | None:
        data = ctypes.create_string_buffer(frame, len(frame) + 1)
        size = self.c.decode(data, len(frame))
        return data.raw[:size] or None

    def begin(self, axes: Sequence[Limits]) -> None:
        packed = b"".join(struct.pack("<iiI", *axis) for axis in axes)
        self.c.begin(len(axes), packed)

    def answer(self, data: bytes, now: int) -> bytes:
        ctypes.c_uint32.in_dll(self.c, "now").value = now
        size = ctypes.c_uint32.in_dll(self.c, "sent_size")
        size.value = 0
        self.c.receive(data, len(data))
        return bytes((ctypes.c_uint8 * 8192).in_dll(self.c, "sent")[: size.value])


@pytest.fixture(scope="module")
def header(tmp_path_factory: pytest.TempPathFactory) -> Header:
    folder = tmp_path_factory.mktemp("header")
    return Header(compiled("serial_header.c", folder, "-std=c99", *STRICT))


def test_the_header_is_c_and_cpp_without_warnings() -> None:
    for compiler, standard, language in (("gcc", "c99", "c"), ("g++", "c++11", "c++")):
        options = (f"-std={standard}", *STRICT, "-fsyntax-only", "-x", language)
        run(compiler, *options, ARDUINO / "tautscope_serial.h")


def test_cobs_and_crc_of_their_publications() -> None:
    """Examples of Cheshire and Baker's article and others'; the check value of the catalogue."""
    assert binascii.crc_hqx(b"123456789", 0xFFFF) == 0x29B1  # CRC-16/IBM-3740
    for plain, coded in (
        ("45 00 00 2c 4c 79 00 00 40 06 4f 37", "02 45 01 04 2c 4c 79 01 05 40 06 4f 37"),
        ("00", "01 01"),
        ("00 00", "01 01 01"),
        ("11 22 00 33", "03 11 22 02 33"),
    ):
        checked = frames.encode(bytes.fromhex(plain))
        # The CRC has no 0 here, and ends the last block.
        crc = binascii.crc_hqx(bytes.fromhex(plain), 0xFFFF).to_bytes(2, "little")
        assert 0 not in crc
        expected = bytearray(bytes.fromhex(coded))
        at = 0
        while at + expected[at] < len(expected):
            at += expected[at]
        expected[at] += 2
        assert checked == bytes(expected) + crc + b"\0"


@given(message=MESSAGES)
def test_frames_are_the_same_in_both_directions(header: Header, message: bytes) -> None:
    frame = frames.encode(message)
    assert frame == header.encode(message)
    assert frame.index(0) == len(frame) - 1
    assert header.decode(frame[:-1]) == message == frames.decode(frame[:-1])


@given(
    frame=st.binary(min_size=1, max_size=100).map(lambda data: data.replace(b"\0", b"\1"))
    | MESSAGES.map(lambda message: frames.encode(message)[:-1])
)
def test_both_accept_the_same_frames(header: Header, frame: bytes) -> None:
    assert header.decode(frame) == frames.decode(frame)


def test_mutated_frames_are_never_accepted(header: Header) -> None:
    """Each flipped bit, and lost, doubled, swapped and random bytes of random frames."""
    source = random.Random(0)
    for _ in range(100):
        message = source.randbytes(source.randrange(3, 36))
        frame = frames.encode(message)[:-1]
        mutated = {bytes(a ^ (1 << bit if i == at else 0) for i, a in enumerate(frame))
                   for at in range(len(frame)) for bit in range(8)}  # fmt: skip
        for _ in range(100):
            at, to = source.randrange(len(frame)), source.randrange(len(frame))
            mutated |= {frame[:at] + frame[at + 1 :], frame[:at] + frame[to:]}
            mutated |= {frame[:at] + source.randbytes(2) + frame[at + 2 :]}
        for changed in mutated - {frame, b""}:
            for part in filter(None, changed.split(b"\0")):
                assert frames.decode(part) is None
                assert header.decode(part) is None


def random_step(source: random.Random) -> tuple[str, int, bytes]:
    """What a host, a disturbed line, the motors or the time do: mostly what is usual."""
    setpoints = [source.randint(-1001, 2001), source.randint(-9, 9), source.randint(-1, 256)]
    what = source.choice(["ask"] * 4 + ["line", "wait", "poll", "poll", "fault", "move"])
    if what == "line":
        return what, 0, source.randbytes(source.randrange(60))
    if what != "ask":
        return (
            what,
            source.randrange(30 if what == "wait" else 3),
            bytes([source.choice([0, 0, 4])]),
        )
    body = source.choice([b"", source.randbytes(2), struct.pack("<iii", *setpoints), b"..."])
    usual = {Request.ENABLE: b"\x14\0", Request.SETPOINTS: struct.pack("<iii", 7, 8, 9)}
    kind = source.choice([*Request, 3, 3, 4, 4, source.randrange(256)])
    return what, kind, source.choice([body, usual.get(kind, b"")])  # type: ignore[call-overload]


def test_the_simulated_board_is_the_header(header: Header) -> None:
    """The same requests, silences and faults have the same answers, states and targets."""
    source = random.Random(0)
    header.begin(AXES)
    board, buffer, now = SerialBoard(AXES), bytearray(), 0
    for number in range(20_000):
        what, value, data = random_step(source)
        if what == "wait":
            now += value
        elif what == "fault":
            board.faults[value] = data[0]
            header.put("faults", ctypes.c_uint8, value, data[0])
        elif what == "move":
            board.positions[value] = number
            header.put("positions", ctypes.c_int32, value, number)
        elif what == "poll":
            header.answer(b"", now)
            header.c.poll()
            board.poll(now)
        else:
            sent = data if what == "line" else b"\0" + frames.request(value, number, data)
            buffer += sent
            messages = frames.take_messages(buffer, frames.LONGEST_REQUEST)
            expected = b"".join(board.answer(message, now) for message in messages)
            assert header.answer(sent, now) == expected
        assert header.c.state() == board.state
        if board.state == State.ENABLED:
            assert header.array("targets", ctypes.c_int32) == board.targets


def test_answers_are_read_as_they_were_written(header: Header) -> None:
    header.begin(AXES)
    hello = frames.read_hello(frames.decode(header.answer(frames.request(1, 7), 0)[:-1]) or b"")
    assert hello == frames.Hello(frames.VERSION, tuple(AXES))
    header.put("positions", ctypes.c_int32, 1, -(2**31))
    header.put("faults", ctypes.c_uint8, 2, 77)
    message = frames.decode(header.answer(frames.request(2, 0xFFFF), 0)[:-1]) or b""
    status = frames.read_status(message, 3)
    assert status == frames.Status(0xFFFF, 0, 0, (0, 0, 77), (0, -(2**31), 0))
    assert frames.read_status(message, 2) is None  # of another number of axes
    assert frames.read_hello(message) is None
    other = bytes([0x81, 7, 0, 9]) + message[4:]
    assert frames.read_hello(other) == frames.Hello(9, ())


def test_the_page_has_the_numbers_and_an_example() -> None:
    page = (ROOT / "docs" / "serial.md").read_text(encoding="utf-8")
    for names in (
        {one.value: one.name.lower() for one in kind} for kind in (Request, State, Refusal)
    ):
        for number, name in names.items():
            assert re.search(rf"\b{number} {name}\b", page), (number, name)
    for number, name in FAULTS.items():
        assert f"{number} {name}" in page
    spaced = frames.request(Request.SETPOINTS, 7, frames.setpoints([100, -50, 0])).hex(" ")
    assert f"`{spaced}`" in page
    answer = frames.status_answer(4, frames.Status(7, 1, 0, (0, 0, 0), (96, -48, 0))).hex(" ")
    assert f"`{answer}`" in page
    assert f"version {frames.VERSION}" in page


def test_header_and_host_have_the_same_names() -> None:
    text = (ARDUINO / "tautscope_serial.h").read_text(encoding="utf-8")
    enums = [
        [name.split("=")[0].strip().removeprefix("TAUTSCOPE_") for name in block.split(",")]
        for block in re.findall(r"enum \{([^}]*)\}", text)
    ]
    assert [one.name for one in Request] in enums
    assert [one.name for one in State] in enums
    assert [one.name for one in Refusal] in enums
