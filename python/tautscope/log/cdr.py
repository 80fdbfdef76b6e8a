"""Messages of ROS 2 Jazzy, their definitions, and CDR, by rosbags."""

import struct
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from tautscope.errors import RecordError

Message = Mapping[str, Any]
"""Field -> number, text, bytes (of ``uint8[]``), sequence or message."""

_LITTLE_ENDIAN = b"\x00\x01"
_BYTES = {"byte": "uint8", "char": "uint8"}
"""Names of ROS that NumPy lacks."""


@cache
def store() -> Typestore:
    """The types that messages may have."""
    return get_typestore(Stores.ROS2_JAZZY)


@cache
def schema(kind: str) -> bytes:
    """The definition of a type and of the types it uses, in MCAP's ``ros2msg`` format."""
    return store().generate_msgdef(kind, ros_version=2)[0].encode()


def make(kind: str, **fields: Any) -> Any:
    """A message of a type from its fields; one that is not given is 0 or empty.

    A message in it may be a dictionary of its fields.
    """
    types = store()
    for name, described in types.fielddefs[kind][1]:
        fields[name] = _value(described, fields.get(name))
    return types.types[kind](**fields)


def _value(described: FieldDesc, value: Any) -> Any:
    """The value of a field by its description; None is 0 or empty."""
    if described[0] is Nodetype.NAME:
        return value if hasattr(value, "__msgtype__") else make(described[1], **value or {})
    if described[0] is Nodetype.BASE:
        zero = "" if described[1][0] == "string" else 0
        return zero if value is None else value
    element, length = described[1]
    if element[0] is Nodetype.BASE and element[1][0] != "string":
        name = _BYTES.get(element[1][0], element[1][0])
        if isinstance(value, bytes):
            return np.frombuffer(value, name)
        return np.zeros(length, name) if value is None else np.asarray(value, name)
    return [_value(element, each) for each in value or ()]


def encode(message: Any) -> bytes:
    """A message of `make` as little-endian CDR."""
    return bytes(store().serialize_cdr(message, message.__msgtype__))


def decode(kind: str, data: bytes) -> Any:
    """A message of a type from CDR: its fields are attributes, its arrays those of NumPy.

    Raises:
        RecordError: The bytes are not little-endian CDR of this type.
    """
    try:
        if data[:2] != _LITTLE_ENDIAN:
            raise ValueError(f"header {data[:4].hex()}")
        return store().deserialize_cdr(data, kind)
    except (SerdeError, struct.error, ValueError, IndexError, AssertionError, TypeError) as error:
        raise RecordError(kind, str(error), "a message in little-endian CDR") from None
