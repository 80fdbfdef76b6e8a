"""CDR of the messages of a log, against the specification."""

import struct
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import get_types_from_msg
from tautscope.errors import RecordError
from tautscope.log import topics
from tautscope.log.cdr import decode, encode, make, schema, store

KINDS = sorted(set(topics.TYPES.values()))
JOINTS = "sensor_msgs/msg/JointState"
HEADER = b"\x00\x01\x00\x00"


def text(value: str) -> bytes:
    return struct.pack(f"<I{len(value) + 1}s", len(value) + 1, value.encode())


def joints() -> bytes:
    header = {"stamp": {"sec": -3, "nanosec": 7}, "frame_id": "guide"}
    return encode(make(JOINTS, header=header, name=["a", "bend"], position=(0.5, -1.25)))


def test_bytes_are_those_of_the_specification() -> None:
    """OMG DDSI-RTPS 2.2, section 10: each field aligned to its size; texts end with a zero."""
    parts = [
        struct.pack("<iI", -3, 7),
        text("guide"),
        struct.pack("<I", 2),
        text("a"),
        text("bend"),
    ]
    expected = b""
    for part in parts:
        expected += bytes(-len(expected) % 4) + part
    expected += bytes(-len(expected) % 4) + struct.pack("<I", 2)
    expected += (
        bytes(-len(expected) % 8) + struct.pack("<2d", 0.5, -1.25) + struct.pack("<2I", 0, 0)
    )
    assert joints() == HEADER + expected


def test_fields_come_back() -> None:
    found = decode(JOINTS, joints())
    assert (found.header.stamp.sec, found.header.frame_id) == (-3, "guide")
    assert (found.name, found.position.tolist()) == (["a", "bend"], [0.5, -1.25])
    assert found.velocity.size == found.effort.size == 0
    image = make("sensor_msgs/msg/CompressedImage", format="png", data=b"\x00\xff")
    assert decode("sensor_msgs/msg/CompressedImage", encode(image)).data.tobytes() == b"\x00\xff"


@pytest.mark.parametrize("kind", KINDS)
def test_the_schema_of_a_type_is_complete(kind: str) -> None:
    found = get_types_from_msg(schema(kind).decode(), kind)
    assert kind in found
    for name, (_, fields) in found.items():
        assert fields == store().fielddefs[name][1], name


def test_a_truncated_message_is_rejected() -> None:
    whole = joints()
    for cut in range(len(whole)):
        with pytest.raises(RecordError, match="JointState"):
            decode(JOINTS, whole[:cut])


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=200), st.sampled_from(KINDS))
def test_any_bytes_give_a_message_or_a_named_error(noise: bytes, kind: str) -> None:
    with suppress(RecordError):
        decode(kind, HEADER + noise)


def test_what_is_not_given_is_zero_or_empty() -> None:
    for kind in KINDS:
        empty = decode(kind, encode(make(kind)))
        assert encode(empty) == encode(make(kind)), kind
    assert not np.any(
        decode("sensor_msgs/msg/CameraInfo", encode(make("sensor_msgs/msg/CameraInfo"))).k
    )
