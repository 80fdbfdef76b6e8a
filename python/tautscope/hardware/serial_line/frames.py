"""Frames and messages of the serial line protocol, version 1, as docs/serial.md has them."""

import binascii
import struct
from collections.abc import Iterator, Sequence
from enum import IntEnum
from typing import NamedTuple

from tautscope.config.microcontroller import MOST_AXES

VERSION = 1
LONGEST = 5 + 12 * MOST_AXES + 2 + 1
"""Longest answer, that to a hello, as a frame without its 0 [byte]."""
LONGEST_REQUEST = 3 + 4 * MOST_AXES + 2 + 1
"""Longest request, set-points, as a frame without its 0 [byte]."""
_ANSWER = 0x80


class Request(IntEnum):
    """Kinds of requests; that of the answer is 0x80 more."""

    HELLO = 1
    READ = 2
    ENABLE = 3
    SETPOINTS = 4
    STOP = 5
    DISABLE = 6


class State(IntEnum):
    """What the microcontroller does."""

    DISABLED = 0
    ENABLED = 1
    STOPPED = 2
    SILENCE = 3
    FAULT = 4


class Refusal(IntEnum):
    """Whether a request was carried out, else why not."""

    DONE = 0
    UNKNOWN = 1
    LENGTH = 2
    STATE = 3
    RANGE = 4


FAULTS = {
    1: "driver",
    2: "overheating",
    3: "supply voltage",
    4: "limit switch",
    5: "encoder",
    6: "stall",
}
"""Faults of an axis; numbers from 64 on are the user's own."""


class Limits(NamedTuple):
    """Range of an axis [counts], and its largest speed [counts/s]."""

    lower: int
    upper: int
    speed: int


class Hello(NamedTuple):
    """The answer to a hello."""

    version: int
    axes: tuple[Limits, ...]


class Status(NamedTuple):
    """Any other answer: number of its request, state, refusal, fault and position of each axis."""

    number: int
    state: int
    refusal: int
    faults: tuple[int, ...]
    positions: tuple[int, ...]


def encode(message: bytes) -> bytes:
    """A frame: message and CRC-16/IBM-3740, by COBS, and a 0; at most 251 bytes of message."""
    checked = message + struct.pack("<H", binascii.crc_hqx(message, 0xFFFF))
    return b"".join(bytes([len(part) + 1]) + part for part in checked.split(b"\0")) + b"\0"


def decode(frame: bytes) -> bytes | None:
    """The message in a frame without its 0; None if it is damaged."""
    parts, at = [], 0
    while at < len(frame):
        end = at + frame[at]
        if end > len(frame):
            return None
        parts.append(frame[at + 1 : end])
        at = end
    checked = b"\0".join(parts)
    message, crc = checked[:-2], checked[-2:]
    is_intact = crc == struct.pack("<H", binascii.crc_hqx(message, 0xFFFF))
    return message if message and is_intact else None


def take_messages(buffer: bytearray, longest: int = LONGEST) -> Iterator[bytes]:
    """Take the complete frames from the front of a buffer; the messages of the intact ones."""
    *frames, rest = buffer.split(b"\0")
    buffer[:] = rest[: longest + 1]
    for frame in frames:
        if len(frame) <= longest and (message := decode(bytes(frame))) is not None:
            yield message


def request(kind: int, number: int, body: bytes = b"") -> bytes:
    """The frame of a request."""
    return encode(struct.pack("<BH", kind, number) + body)


def setpoints(targets: Sequence[int]) -> bytes:
    """The body of set-points [counts]."""
    return struct.pack(f"<{len(targets)}i", *targets)


def read_setpoints(body: bytes) -> tuple[int, ...]:
    """The targets [counts] in the body of set-points."""
    return struct.unpack(f"<{len(body) // 4}i", body)


def number_of(message: bytes) -> int:
    """The number of the request that a message answers; -1 if it is no answer."""
    is_answer = len(message) >= 5 and message[0] & _ANSWER
    return int.from_bytes(message[1:3], "little") if is_answer else -1


def hello_answer(number: int, hello: Hello) -> bytes:
    """The frame that answers a hello."""
    head = struct.pack("<BHBB", Request.HELLO | _ANSWER, number, hello.version, len(hello.axes))
    return encode(head + b"".join(struct.pack("<iiI", *axis) for axis in hello.axes))


def status_answer(kind: int, status: Status) -> bytes:
    """The frame that answers any other request, or a refused hello."""
    number, state, refusal, *_ = status
    axes = zip(status.faults, status.positions, strict=True)
    body = b"".join(struct.pack("<Bi", *axis) for axis in axes)
    return encode(struct.pack("<BHBB", kind | _ANSWER, number, state, refusal) + body)


def read_hello(message: bytes) -> Hello | None:
    """Read the answer to a hello; of another version its axes are unknown."""
    if message[0] != Request.HELLO | _ANSWER or len(message) < 5:
        return None
    version, body = message[3], message[5:]
    if version != VERSION:
        return Hello(version, ())
    if len(body) != 12 * message[4]:
        return None
    return Hello(version, tuple(map(Limits._make, struct.iter_unpack("<iiI", body))))


def read_status(message: bytes, axes: int) -> Status | None:
    """Read any other answer; None if it is none, or of another number of axes."""
    if number_of(message) < 0 or len(message) != 5 + 5 * axes:
        return None
    faults, positions = zip(*struct.iter_unpack("<Bi", message[5:]), strict=True)
    return Status(number_of(message), message[3], message[4], faults, positions)
