"""ROS 2 types: definitions, type hashes, and CDR, by rosbags.

The definitions are those of ROS 2 Jazzy; `crtk_msgs` and the services are added from their texts.
"""

from __future__ import annotations

import struct
from functools import cache
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc, Typesdict
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from tautscope.errors import MessageError

MESSAGES = {
    "crtk_msgs/msg/OperatingState": "std_msgs/Header header\nstring state\nbool is_homed\n"
    "bool is_busy",
    "crtk_msgs/msg/StringStamped": "std_msgs/Header header\nstring string",
}
"""Messages that are not part of ROS 2 -> definition."""
SERVICES = {
    "lifecycle_msgs/srv/ChangeState": ("lifecycle_msgs/Transition transition", "bool success"),
    "lifecycle_msgs/srv/GetState": ("", "lifecycle_msgs/State current_state"),
    "lifecycle_msgs/srv/GetAvailableStates": ("", "lifecycle_msgs/State[] available_states"),
    "lifecycle_msgs/srv/GetAvailableTransitions": (
        "",
        "lifecycle_msgs/TransitionDescription[] available_transitions",
    ),
    "rcl_interfaces/srv/DescribeParameters": (
        "string[] names",
        "rcl_interfaces/ParameterDescriptor[] descriptors",
    ),
    "rcl_interfaces/srv/GetParameters": (
        "string[] names",
        "rcl_interfaces/ParameterValue[] values",
    ),
    "rcl_interfaces/srv/GetParameterTypes": ("string[] names", "uint8[] types"),
    "rcl_interfaces/srv/ListParameters": (
        "string[] prefixes\nuint64 depth",
        "rcl_interfaces/ListParametersResult result",
    ),
    "rcl_interfaces/srv/SetParameters": (
        "rcl_interfaces/Parameter[] parameters",
        "rcl_interfaces/SetParametersResult[] results",
    ),
    "rcl_interfaces/srv/SetParametersAtomically": (
        "rcl_interfaces/Parameter[] parameters",
        "rcl_interfaces/SetParametersResult result",
    ),
}
"""Services -> definitions of request and response."""
_EVENT_INFO = "service_msgs/msg/ServiceEventInfo"
_LITTLE_ENDIAN = b"\x00\x01"
_BYTES = {"byte": "uint8", "char": "uint8"}
"""Names of ROS that NumPy lacks."""


@cache
def _store() -> Typestore:
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in MESSAGES.items():
        store.register(get_types_from_msg(text, name))
    # A char of ROS is a uint8 in the description that the hash is of.
    info = "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\n"
    store.fielddefs[_EVENT_INFO] = ([], _fields(info + "int64 sequence_number"))
    for name, (request, response) in SERVICES.items():
        parts: list[tuple[str, list[tuple[str, FieldDesc]]]] = [
            (f"{name}_Request", _fields(request)),
            (f"{name}_Response", _fields(response)),
        ]
        # What introspection of a service publishes is a part of its hash (REP 2016).
        event: list[tuple[str, FieldDesc]] = [
            ("info", (Nodetype.NAME, _EVENT_INFO)),
            ("request", (Nodetype.SEQUENCE, ((Nodetype.NAME, f"{name}_Request"), 1))),
            ("response", (Nodetype.SEQUENCE, ((Nodetype.NAME, f"{name}_Response"), 1))),
        ]
        members: list[tuple[str, FieldDesc]] = [
            (f"{part}_message", (Nodetype.NAME, f"{name}_{part.capitalize()}"))
            for part in ("request", "response", "event")
        ]
        types: Typesdict = {
            kind: ([], fields)
            for kind, fields in (*parts, (f"{name}_Event", event), (name, members))
        }
        store.register(types)
    return store


def _fields(text: str) -> list[tuple[str, FieldDesc]]:
    if not text:  # the definition language of ROS gives an empty message this member
        text = "uint8 structure_needs_at_least_one_member"
    return next(iter(get_types_from_msg(text, "tautscope/msg/Part").values()))[1]


@cache
def type_hash(kind: str) -> str:
    """The REP 2016 hash of a message (``pkg/msg/Name``) or service (``pkg/srv/Name``)."""
    return _store().hash_rihs01(kind)


def make(kind: str, **fields: Any) -> Any:
    """A message of a type from its fields; one that is not given is 0 or empty.

    A message in it may be a dictionary of its fields.
    """
    for name, described in _store().fielddefs[kind][1]:
        fields[name] = _value(described, fields.get(name))
    return _store().types[kind](**fields)


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
        return np.zeros(length, name) if value is None else np.asarray(value, name)
    return [_value(element, each) for each in value or ()]


def encode(message: Any) -> bytes:
    """A message as little-endian CDR."""
    return bytes(_store().serialize_cdr(message, message.__msgtype__))


def decode(kind: str, data: bytes) -> Any:
    """A message of a type from CDR.

    Raises:
        MessageError: The bytes are not little-endian CDR of this type.
    """
    try:
        if data[:2] != _LITTLE_ENDIAN:
            raise ValueError(f"header {data[:4].hex()}")
        return _store().deserialize_cdr(data, kind)
    except (SerdeError, struct.error, ValueError, IndexError, AssertionError, TypeError) as error:
        raise MessageError(kind, str(error), "a message in little-endian CDR") from None


def stamp(nanoseconds: int) -> Any:
    """builtin_interfaces/msg/Time for a wall clock time [ns since 1970]."""
    sec, nanosec = divmod(nanoseconds, 10**9)
    return make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)


def header(nanoseconds: int, frame: str) -> Any:
    """std_msgs/msg/Header for a wall clock time [ns since 1970]; 0 is a time that is not known."""
    return make("std_msgs/msg/Header", stamp=stamp(nanoseconds), frame_id=frame)
