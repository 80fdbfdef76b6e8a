"""CDR encoding and decoding of ROS 2 messages from their definitions.

OMG DDSI-RTPS 2.2, section 10 (CDR, little endian): a header of four bytes, then each field aligned
to its size, relative to the end of the header. Strings end with a zero, which their length counts.
The definitions are those of ROS 2 Jazzy without comments and constants.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from tautscope.errors import RecordError

DEFINITIONS = {
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/msg/String": "string data",
    "std_msgs/msg/Float64": "float64 data",
    "std_msgs/msg/MultiArrayDimension": "string label\nuint32 size\nuint32 stride",
    "std_msgs/msg/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset",
    "std_msgs/msg/Float64MultiArray": "std_msgs/MultiArrayLayout layout\nfloat64[] data",
    "geometry_msgs/msg/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/msg/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/msg/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/msg/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose",
    "sensor_msgs/msg/JointState": "std_msgs/Header header\nstring[] name\nfloat64[] position\n"
    "float64[] velocity\nfloat64[] effort",
    "sensor_msgs/msg/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data",
    "sensor_msgs/msg/RegionOfInterest": "uint32 x_offset\nuint32 y_offset\nuint32 height\n"
    "uint32 width\nbool do_rectify",
    "sensor_msgs/msg/CameraInfo": "std_msgs/Header header\nuint32 height\nuint32 width\n"
    "string distortion_model\nfloat64[] d\nfloat64[9] k\nfloat64[9] r\nfloat64[12] p\n"
    "uint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi",
    "diagnostic_msgs/msg/KeyValue": "string key\nstring value",
    "diagnostic_msgs/msg/DiagnosticStatus": "byte level\nstring name\nstring message\n"
    "string hardware_id\ndiagnostic_msgs/KeyValue[] values",
    "diagnostic_msgs/msg/DiagnosticArray": "std_msgs/Header header\n"
    "diagnostic_msgs/DiagnosticStatus[] status",
    "rcl_interfaces/msg/Log": "builtin_interfaces/Time stamp\nuint8 level\nstring name\n"
    "string msg\nstring file\nstring function\nuint32 line",
}
"""Type -> its fields, one per line."""

_HEADER = b"\x00\x01\x00\x00"
_CODES = {
    "bool": "?",
    "byte": "B",
    "uint8": "B",
    "int32": "i",
    "uint32": "I",
    "float64": "d",
}
_FIELD = re.compile(r"([\w/]+?)(\[(\d*)\])? (\w+)")

Message = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class _Field:
    name: str
    base: str
    """A primitive, ``string`` or another type of `DEFINITIONS`."""
    count: int | None
    """None: a single value; 0: a sequence of any length; otherwise an array of this length."""


@cache
def _fields(kind: str) -> tuple[_Field, ...]:
    fields = []
    for line in DEFINITIONS[kind].splitlines():
        match = _FIELD.fullmatch(line)
        assert match, line
        base, is_array, length, name = match.groups()
        base = base.replace("/", "/msg/")
        fields.append(_Field(name, base, int(length or 0) if is_array else None))
    return tuple(fields)


@cache
def schema(kind: str) -> bytes:
    """The definition of a type and of the types it uses, in MCAP's ``ros2msg`` format."""
    parts, queue = [DEFINITIONS[kind] + "\n"], list(_parts_of(kind))
    done: set[str] = set()
    while queue:
        part = queue.pop(0)
        if part not in done:
            done.add(part)
            parts.append(f"MSG: {part.replace('/msg/', '/')}\n{DEFINITIONS[part]}\n")
            queue += _parts_of(part)
    return (80 * "=" + "\n").join(parts).encode()


def _parts_of(kind: str) -> Iterable[str]:
    return (field.base for field in _fields(kind) if field.base in DEFINITIONS)


def encode(kind: str, message: Message) -> bytes:
    """Encode a message as CDR.

    Args:
        kind: A type of `DEFINITIONS`.
        message: Field -> number, text, bytes (for ``uint8[]``), sequence or message.
    """
    out = bytearray(_HEADER)
    _write_message(out, kind, message)
    return bytes(out)


def _write_message(out: bytearray, kind: str, message: Message) -> None:
    for field in _fields(kind):
        value = message[field.name]
        if field.count is None:
            _write(out, field.base, (value,))
            continue
        if field.count == 0:
            _write(out, "uint32", (len(value),))
        if field.base == "uint8":
            out += value
        elif len(value):
            _write(out, field.base, value)


def _write(out: bytearray, base: str, values: Sequence[Any]) -> None:
    code = _CODES.get(base)
    if code is not None:
        out += bytes((len(_HEADER) - len(out)) % struct.calcsize(code))
        out += struct.pack(f"<{len(values)}{code}", *values)
        return
    for value in values:
        if base == "string":
            text = value.encode()
            _write(out, "uint32", (len(text) + 1,))
            out += text + b"\0"
        else:
            _write_message(out, base, value)


def decode(kind: str, data: bytes) -> dict[str, Any]:
    """Decode a message from CDR.

    Raises:
        RecordError: The bytes are not little-endian CDR of this type.
    """
    try:
        if data[:2] != _HEADER[:2]:
            raise ValueError(f"header {data[:4].hex()}")
        return _Reader(data).message(kind)
    except (struct.error, ValueError, IndexError) as error:
        raise RecordError(kind, str(error), "a message in little-endian CDR") from None


class _Reader:
    def __init__(self, data: bytes) -> None:
        self._data = memoryview(data)[len(_HEADER) :]
        self._at = 0

    def message(self, kind: str) -> dict[str, Any]:
        return {field.name: self._field(field) for field in _fields(kind)}

    def _field(self, field: _Field) -> Any:
        if field.count is None:
            return self._values(field.base, 1)[0]
        count = field.count or self._values("uint32", 1)[0]
        if field.base == "uint8":
            return self._bytes(count)
        return self._values(field.base, count) if count else ()

    def _values(self, base: str, count: int) -> Sequence[Any]:
        code = _CODES.get(base)
        if code is not None:
            size = struct.calcsize(code)
            self._at += -self._at % size
            return struct.unpack(f"<{count}{code}", self._bytes(count * size))
        if count > len(self._data) - self._at:
            raise ValueError(f"{count} of {base} in {len(self._data) - self._at} bytes")
        if base == "string":
            return [self._bytes(self._values("uint32", 1)[0])[:-1].decode() for _ in range(count)]
        return [self.message(base) for _ in range(count)]

    def _bytes(self, count: int) -> bytes:
        begin, self._at = self._at, self._at + count
        if self._at > len(self._data):
            raise ValueError(f"ends at byte {len(self._data)} of {self._at}")
        return bytes(self._data[begin : self._at])
