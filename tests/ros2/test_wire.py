"""Keys, liveliness tokens and attachments as the design document of rmw_zenoh shows them."""

import pytest
import zenoh
from hypothesis import given
from hypothesis import strategies as st
from ros2.peers import free_endpoint
from tautscope.errors import ConfigError, MessageError
from tautscope.ros2 import types, wire
from tautscope.ros2.session import Node, check_loopback
from tautscope.ros2.wire import Entity, Identity, Qos


def test_key_is_that_of_the_design_document() -> None:
    kind = "std_msgs/msg/String"
    rihs = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    assert wire.key(0, "/chatter", kind, rihs) == f"0/chatter/std_msgs::msg::dds_::String_/{rihs}"


def test_tokens_are_those_of_the_design_document() -> None:
    node = Identity(2, "aac3178e146ba6f1fc6e6a4085e77f21", "", "listener")
    path = "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0"
    assert node.node_token() == f"{path}/0/NN/%/%/listener"
    kind, rihs = "std_msgs/msg/String", types.type_hash("std_msgs/msg/String")
    token = node.token(10, Entity.SUBSCRIPTION, "/chatter", kind=kind, rihs=rihs, qos=Qos())
    assert token == (
        f"{path}/10/MS/%/%/listener/%chatter/std_msgs::msg::dds_::String_/{rihs}/::,10:,:,:,,"
    )
    inside = Identity(0, "z", "/lab/left", "tautscope")
    assert inside.path == "/lab/left/tautscope"
    assert inside.node_token().endswith("/NN/%/%lab%left/tautscope")


@pytest.mark.parametrize("distribution", [wire.HUMBLE, wire.JAZZY])
def test_keys_of_humble_have_no_type_hashes(distribution: str) -> None:
    kind = "std_msgs/msg/String"
    name = "TypeHashNotSupported" if distribution == "humble" else types.type_hash(kind)
    endpoint = free_endpoint()
    settings = zenoh.Config()
    settings.insert_json5("connect/endpoints", f'["{endpoint}"]')
    settings.insert_json5("scouting/multicast/enabled", "false")
    with Node("talker", distribution=distribution, connect="", listen=endpoint) as node:
        talker = node.publisher("/chatter", kind)
        with zenoh.open(settings) as session:
            tokens = session.liveliness().get("@ros2_lv/0/*/0/*/MP/**", timeout=5.0)
            found = [str(reply.ok.key_expr) for reply in tokens if reply.ok]
        key = str(talker._publisher.key_expr)
    assert [each.split("/")[-2] for each in found] == [name]
    assert key == f"0/chatter/std_msgs::msg::dds_::String_/{name}"


def test_quality_of_sensor_data() -> None:
    assert str(Qos(depth=1, is_reliable=False)) == "2::,1:,:,:,,"


@given(
    st.integers(-(2**63), 2**63 - 1),
    st.integers(-(2**63), 2**63 - 1),
    st.binary(min_size=16, max_size=16),
)
def test_attachments_are_read_as_written(sequence: int, sent_at: int, source: bytes) -> None:
    data = wire.attachment(sequence, sent_at, source)
    assert wire.read_attachment(data) == (sequence, sent_at, source)


@given(st.binary(max_size=40))
def test_other_attachments_are_refused(data: bytes) -> None:
    if len(data) == 33 and data[16] == 16:
        return
    with pytest.raises(MessageError, match="attachment"):
        wire.read_attachment(data)


@pytest.mark.parametrize(
    "endpoint", ["tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/192.168.0.4:7447", "udp/127.0.0.1:1", ""]
)
def test_the_network_cannot_connect(endpoint: str) -> None:
    with pytest.raises(ConfigError, match="listen"):
        Node("tautscope", listen=endpoint)


@pytest.mark.parametrize("endpoint", ["tcp/127.0.0.1:7447", "tcp/localhost:0", "tcp/[::1]:7447"])
def test_this_computer_can_connect(endpoint: str) -> None:
    check_loopback(endpoint)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"namespace": "left"}, "namespace"),
        ({"namespace": "/a b"}, "namespace"),
        ({"domain": 233}, "domain"),
        ({"connect": "127.0.0.1"}, "endpoint"),
    ],
)
def test_bad_options_are_named(options: dict[str, object], field: str) -> None:
    with pytest.raises(ConfigError, match=field):
        Node("tautscope", **options)  # type: ignore[arg-type]
