"""Services of the node: lifecycle, parameters, and any bytes."""

import random

import numpy as np
from driving import START, drive
from ros2.peers import Peers
from service_client import ATTACHMENT, Client
from tautscope.ros2 import messages, types
from tautscope.ros2.lifecycle import State

STRING, GET = "crtk_msgs/msg/StringStamped", "rcl_interfaces/srv/GetParameters"
IMAGE = "sensor_msgs/msg/Image"
IMAGE_FIELDS = {
    "header": types.header(1, "endoscope"),
    "height": 1,
    "width": 2,
    "encoding": "bgr8",
    "is_bigendian": 0,
    "step": 6,
    "data": np.zeros(6, np.uint8),
}


def test_services_change_and_read_the_state(both: Peers, client: Client) -> None:
    def call(name: str, kind: str, **fields: object):
        return client.call(name, f"lifecycle_msgs/srv/{kind}", **fields)

    def change(number: int, label: str = "") -> bool:
        transition = types.make("lifecycle_msgs/msg/Transition", id=number, label=label)
        return bool(call("change_state", "ChangeState", transition=transition).success)

    empty = {"structure_needs_at_least_one_member": 0}
    assert call("get_state", "GetState", **empty).current_state.label == "unconfigured"
    assert not change(3)
    assert change(1)
    assert call("get_state", "GetState", **empty).current_state.label == "inactive"
    with both.at_rest(START):
        assert change(0, "activate")
    assert both.control.operating_state == "ENABLED"
    found = call("get_available_transitions", "GetAvailableTransitions", **empty)
    labels = [each.transition.label for each in found.available_transitions]
    assert labels == ["deactivate", "shutdown"]
    assert change(0, "shutdown")
    assert both.control.lifecycle.state is State.FINALIZED
    assert both.control.run is None


def test_parameters_are_read_and_set(both: Peers, client: Client) -> None:
    both.enable(START)
    before = client.get_parameter("compensation")
    assert (before.type, before.double_value) == (3, 1.0)
    results = client.set_parameters(("compensation", 0.5), ("compensation", 1.5), ("profile", 0))
    assert [each.successful for each in results] == [True, False, False]
    assert "got 1.5, expected 0 to 1" in results[1].reason
    assert client.get_parameter("compensation").double_value == 0.5
    asked = [client.parameter("compensation", 0.1), client.parameter("profile", 0)]
    kind = "rcl_interfaces/srv/SetParametersAtomically"
    atomic = client.call("set_parameters_atomically", kind, parameters=asked)
    assert not atomic.result.successful
    assert client.get_parameter("compensation").double_value == 0.5


def test_any_bytes_to_a_topic_or_service_are_answered_or_refused(
    both: Peers, client: Client
) -> None:
    both.enable(START)
    drive(both, 5)
    random_ = random.Random(20)
    names = types.make("rcl_interfaces/srv/GetParameters_Request", names=["compensation", "a"])
    good = [
        (both.requests, types.make(STRING, header=types.header(1, ""), string="reset")),
        (both.servo, messages.joint_state(1, both.joints, START)),
        (both.positions, messages.joint_state(1, both.joints, START)),
        (both.images, types.make(IMAGE, **IMAGE_FIELDS)),
    ]
    replies = []
    for _ in range(150):
        for publisher, message in good:
            publisher.send(damaged(types.encode(message), random_))
        payload = damaged(types.encode(names), random_)
        attachment = damaged(ATTACHMENT, random_)
        replies.append(client.send("get_parameters", GET, payload, attachment))
        drive(both, 1)
    assert both.control.operating_state == "ENABLED"
    assert both.control.run.loop.supervision.flags == ()  # type: ignore[union-attr]
    client.get_parameter("compensation")  # answered after the others
    answers = [reply.try_recv() for reply in replies]
    assert any(each is not None and each.err is not None for each in answers)
    shown = [each.data for each in both.drain(both.warnings)]
    for topic in ("servo_jp", "state_command"):
        assert any(text.startswith(f"refused: /instrument/{topic}") for text in shown), topic


def damaged(data: bytes, random_: random.Random) -> bytes:
    """A message with changed bytes, cut off."""
    found = bytearray(data)
    for _ in range(1 + random_.randrange(4)):
        found[random_.randrange(min(len(found), 120))] = random_.randrange(256)
    return bytes(found[: random_.randrange(len(found))])
