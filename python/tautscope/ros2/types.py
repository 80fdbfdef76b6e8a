"""ROS 2 types beside those of logs: definitions of `crtk_msgs` and of services, and type hashes."""

from functools import cache
from typing import Any

from rosbags.interfaces import Nodetype
from rosbags.interfaces.typing import FieldDesc, Typesdict
from rosbags.typesys import get_types_from_msg

from tautscope.errors import MessageError, RecordError
from tautscope.log import cdr
from tautscope.log.cdr import encode, make, store
from tautscope.log.fields import header_of, stamp_of

__all__ = ["decode", "encode", "header", "make", "stamp", "type_hash"]

MESSAGES = {
    "crtk_msgs/msg/OperatingState": "std_msgs/Header header\nstring state\nbool is_homed\n"
    "bool is_busy",
    "crtk_msgs/msg/StringStamped": "std_msgs/Header header\nstring string",
}
"""Messages that are not part of ROS 2 -> definition."""
SERVICES = {
    "lifecycle_msgs": {
        "ChangeState": ("Transition transition", "bool success"),
        "GetState": ("", "State current_state"),
        "GetAvailableStates": ("", "State[] available_states"),
        "GetAvailableTransitions": ("", "TransitionDescription[] available_transitions"),
    },
    "rcl_interfaces": {
        "DescribeParameters": ("string[] names", "ParameterDescriptor[] descriptors"),
        "GetParameters": ("string[] names", "ParameterValue[] values"),
        "GetParameterTypes": ("string[] names", "uint8[] types"),
        "ListParameters": ("string[] prefixes\nuint64 depth", "ListParametersResult result"),
        "SetParameters": ("Parameter[] parameters", "SetParametersResult[] results"),
        "SetParametersAtomically": ("Parameter[] parameters", "SetParametersResult result"),
    },
}
"""Package -> service -> definitions of request and response, with types of the package."""
_EVENT_INFO = "service_msgs/msg/ServiceEventInfo"


def _register() -> None:
    known = store()
    for name, text in MESSAGES.items():
        known.register(get_types_from_msg(text, name))
    # A char of ROS is a uint8 in the description that the hash is of.
    info = "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\n"
    known.fielddefs[_EVENT_INFO] = ([], _fields("service_msgs", info + "int64 sequence_number"))
    found = ((package, *one) for package, each in SERVICES.items() for one in each.items())
    for package, service, (request, response) in found:
        name = f"{package}/srv/{service}"
        event: list[tuple[str, FieldDesc]] = [("info", (Nodetype.NAME, _EVENT_INFO))]
        members: list[tuple[str, FieldDesc]] = []
        for part in ("request", "response", "event"):
            kind = f"{name}_{part.capitalize()}"
            event.append((part, (Nodetype.SEQUENCE, ((Nodetype.NAME, kind), 1))))
            members.append((f"{part}_message", (Nodetype.NAME, kind)))
        types: Typesdict = {
            f"{name}_Request": ([], _fields(package, request)),
            f"{name}_Response": ([], _fields(package, response)),
            # What introspection of a service publishes is a part of its hash (REP 2016).
            f"{name}_Event": ([], event[:-1]),
            name: ([], members),
        }
        known.register(types)


def _fields(package: str, text: str) -> list[tuple[str, FieldDesc]]:
    if not text:  # the definition language of ROS gives an empty message this member
        text = "uint8 structure_needs_at_least_one_member"
    return next(iter(get_types_from_msg(text, f"{package}/msg/Part").values()))[1]


@cache
def type_hash(kind: str) -> str:
    """The REP 2016 hash of a message (``pkg/msg/Name``) or service (``pkg/srv/Name``)."""
    return store().hash_rihs01(kind)


def decode(kind: str, data: bytes) -> Any:
    """A message of a type from little-endian CDR; else a `MessageError`."""
    try:
        return cdr.decode(kind, data)
    except RecordError as error:
        raise MessageError(error.field, error.value, error.allowed) from None


def stamp(nanoseconds: int) -> Any:
    """builtin_interfaces/msg/Time for a wall clock time [ns since 1970]."""
    return make("builtin_interfaces/msg/Time", **stamp_of(nanoseconds))


def header(nanoseconds: int, frame: str) -> Any:
    """std_msgs/msg/Header for a wall clock time [ns since 1970]; 0 is a time that is not known."""
    return make("std_msgs/msg/Header", **header_of(nanoseconds, frame))


_register()
