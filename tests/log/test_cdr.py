"""CDR encoding and message definitions, compared with rosbags."""

from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from tautscope.errors import RecordError
from tautscope.log.cdr import DEFINITIONS, _Field, _fields, decode, encode, schema

STORE = get_typestore(Stores.ROS2_JAZZY)
KINDS = sorted(DEFINITIONS)

TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)
PRIMITIVES = {
    "bool": st.booleans(),
    "byte": st.integers(0, 127),  # rosbags packs it with a sign
    "uint8": st.integers(0, 255),
    "int32": st.integers(-(2**31), 2**31 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "float64": st.floats(allow_nan=False),
    "string": TEXT,
}


def values(kind: str) -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries({field.name: of_field(field) for field in _fields(kind)})


def of_field(field: _Field) -> st.SearchStrategy[Any]:
    one = PRIMITIVES[field.base] if field.base in PRIMITIVES else values(field.base)
    if field.count is None:
        return one
    if field.base == "uint8":
        return st.binary(max_size=9)
    if field.count:
        return st.lists(one, min_size=field.count, max_size=field.count)
    return st.lists(one, max_size=4)


def as_rosbags(kind: str, message: dict[str, Any]) -> Any:
    def convert(field: _Field, value: Any) -> Any:
        if field.count is not None and field.base == "uint8":
            return np.frombuffer(value, np.uint8)
        if field.count is not None and field.base == "float64":
            return np.array(value, np.float64)
        if field.base not in DEFINITIONS:
            return value
        if field.count is None:
            return as_rosbags(field.base, value)
        return [as_rosbags(field.base, item) for item in value]

    fields = {field.name: convert(field, message[field.name]) for field in _fields(kind)}
    return STORE.types[kind](**fields)


def plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, list | tuple) else value


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_bytes_are_those_of_rosbags(kind: str, data: st.DataObject) -> None:
    message = data.draw(values(kind))
    theirs = bytes(STORE.serialize_cdr(as_rosbags(kind, message), kind))
    assert encode(kind, message) == theirs
    assert plain(decode(kind, theirs)) == message


@pytest.mark.parametrize("kind", KINDS)
def test_definitions_are_those_of_ros(kind: str) -> None:
    found = get_types_from_msg(schema(kind).decode(), kind)
    assert kind in found
    for name, (_, fields) in found.items():
        assert fields == STORE.fielddefs[name][1], name


@settings(max_examples=25, deadline=None)
@given(data=st.data())
def test_a_truncated_message_is_rejected(data: st.DataObject) -> None:
    kind = "sensor_msgs/msg/JointState"
    whole = encode(kind, data.draw(values(kind)))
    cut = data.draw(st.integers(0, len(whole) - 1))
    with pytest.raises(RecordError, match="JointState"):
        decode(kind, whole[:cut])


@settings(max_examples=25, deadline=None)
@given(st.binary(max_size=200), st.sampled_from(KINDS))
def test_any_bytes_give_a_message_or_a_named_error(noise: bytes, kind: str) -> None:
    with suppress(RecordError):
        decode(kind, b"\x00\x01\x00\x00" + noise)
