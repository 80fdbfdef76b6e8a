"""Types, hashes and CDR against independent implementations."""

import random

import numpy as np
import pytest
from tautscope.errors import MessageError
from tautscope.ros2 import types

# As published: the type hash in `ros2 topic info --verbose` (std_msgs/msg/String, REP 2016), and
# those of the services of rcl_interfaces that the crate hiroz 0.2.1 uses with rmw_zenoh of Jazzy.
PUBLISHED = {
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "rcl_interfaces/msg/ParameterEvent": (
        "043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204"
    ),
    "rcl_interfaces/srv/DescribeParameters": (
        "845b484d71eb0673dae682f2e3ba3c4851a65a3dcfb97bddd82c5b57e91e4cff"
    ),
    "rcl_interfaces/srv/GetParameters": (
        "bf9803d5c74cf989a5de3e0c2e99444599a627c7ff75f97b8c05b01003675cbc"
    ),
    "rcl_interfaces/srv/GetParameterTypes": (
        "da199c878688b3e530bdfe3ca8f74cb9fa0c303101e980a9e8f260e25e1c80ca"
    ),
    "rcl_interfaces/srv/ListParameters": (
        "3e6062bfbb27bfb8730d4cef2558221f51a11646d78e7bb30a1e83afac3aad9d"
    ),
    "rcl_interfaces/srv/SetParameters": (
        "56eed9a67e169f9cb6c1f987bc88f868c14a8fc9f743a263bc734c154015d7e0"
    ),
    "rcl_interfaces/srv/SetParametersAtomically": (
        "0e192ef259c07fc3c07a13191d27002222e65e00ccec653ca05e856f79285fcd"
    ),
}
JOINTS = "sensor_msgs/msg/JointState"


@pytest.mark.parametrize("kind", PUBLISHED)
def test_hashes_are_the_published_ones(kind: str) -> None:
    assert types.type_hash(kind) == f"RIHS01_{PUBLISHED[kind]}"


def parameter() -> object:
    """A rcl_interfaces/msg/Parameter with a value in every field."""
    value = types.make(
        "rcl_interfaces/msg/ParameterValue",
        type=3,
        bool_value=True,
        integer_value=1,
        double_value=0.5,
        string_value="text",
        byte_array_value=np.ones(3, np.uint8),
        bool_array_value=np.ones(3, np.bool_),
        integer_array_value=np.ones(3, np.int64),
        double_array_value=np.ones(3),
        string_array_value=["a", "bc"],
    )
    return types.make("rcl_interfaces/msg/Parameter", name="compensation", value=value)


MESSAGES = {
    JOINTS: types.encode(
        types.make(JOINTS, header=types.header(1, "a"), name=["b"], position=[0.025])
    ),
    "crtk_msgs/msg/StringStamped": types.encode(
        types.make("crtk_msgs/msg/StringStamped", header=types.header(1, "a"), string="enable")
    ),
    "sensor_msgs/msg/Joy": types.encode(
        types.make(
            "sensor_msgs/msg/Joy",
            header=types.header(1, ""),
            axes=np.ones(6, np.float32),
            buttons=np.ones(6, np.int32),
        )
    ),
    "rcl_interfaces/srv/SetParameters_Request": types.encode(
        types.make("rcl_interfaces/srv/SetParameters_Request", parameters=[parameter()] * 2)
    ),
}


@pytest.mark.parametrize("kind", MESSAGES)
def test_damaged_messages_are_refused_and_never_crash(kind: str) -> None:
    random_, good, refused = random.Random(20), MESSAGES[kind], 0
    assert types.encode(types.decode(kind, good)) == good
    for _ in range(3000):
        data = bytearray(good[: random_.randrange(len(good) + 1)])
        for _ in range(random_.randrange(4)):
            if data:
                data[random_.randrange(len(data))] = random_.randrange(256)
        try:
            types.decode(kind, bytes(data))
        except MessageError as error:
            assert error.field == kind
            refused += 1
    assert refused > 1000
