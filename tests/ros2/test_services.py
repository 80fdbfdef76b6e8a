"""Services of the node: lifecycle, parameters, and any bytes."""

from __future__ import annotations

import random
import time

import numpy as np
from driving import START, drive
from ros2.peers import Peers
from tautscope.ros2 import messages, types, wire
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


def test_services_change_and_read_the_state(both: Peers) -> None:
    def call(name: str, kind: str, **fields: object):
        request = types.make(f"lifecycle_msgs/srv/{kind}_Request", **fields)
        return service(both, f"/tautscope/{name}", f"lifecycle_msgs/srv/{kind}", request)

    def change(number: int, label: str = "") -> bool:
        transition = types.make("lifecycle_msgs/msg/Transition", id=number, label=label)
        return bool(call("change_state", "ChangeState", transition=transition).success)

    empty = {"structure_needs_at_least_one_member": 0}
    assert call("get_state", "GetState", **empty).current_state.label == "unconfigured"
    assert not change(3)
    assert change(1)
    assert call("get_state", "GetState", **empty).current_state.label == "inactive"
    both.send_position(START)
    both.delivered()
    assert change(0, "activate")
    assert both.control.operating_state == "ENABLED"
    found = call("get_available_transitions", "GetAvailableTransitions", **empty)
    labels = [each.transition.label for each in found.available_transitions]
    assert labels == ["deactivate", "shutdown"]
    assert change(0, "shutdown")
    assert both.control.lifecycle.state is State.FINALIZED
    assert both.control.run is None


def test_parameters_are_read_and_set(both: Peers) -> None:
    def call(kind: str, name: str, **fields: object):
        request = types.make(f"rcl_interfaces/srv/{kind}_Request", **fields)
        return service(both, f"/tautscope/{name}", f"rcl_interfaces/srv/{kind}", request)

    def parameter(name: str, value: float):
        fields = call("GetParameters", "get_parameters", names=["compensation"]).values[0]
        fields.type, fields.double_value = 3, value
        return types.make("rcl_interfaces/msg/Parameter", name=name, value=fields)

    both.enable(START)
    (before,) = call("GetParameters", "get_parameters", names=["compensation"]).values
    assert (before.type, before.double_value) == (3, 1.0)
    asked = [
        parameter("compensation", 0.5),
        parameter("compensation", 1.5),
        parameter("profile", 0),
    ]
    results = call("SetParameters", "set_parameters", parameters=asked).results
    assert [each.successful for each in results] == [True, False, False]
    assert "got 1.5, expected 0 to 1" in results[1].reason
    assert both.control.parameters["compensation"] == 0.5
    atomic = call(
        "SetParametersAtomically",
        "set_parameters_atomically",
        parameters=[parameter("compensation", 0.1), parameter("profile", 0)],
    )
    assert not atomic.result.successful
    assert both.control.parameters["compensation"] == 0.5


def test_any_bytes_to_a_topic_or_service_are_answered_or_refused(both: Peers) -> None:
    both.enable(START)
    drive(both, 5)
    random_ = random.Random(20)
    names = types.make("rcl_interfaces/srv/GetParameters_Request", names=["compensation", "a"])
    good = [
        (both.requests, types.make(STRING, header=types.header(1, ""), string="reset")),
        (both.servo, messages.joint_state(1, START)),
        (both.positions, messages.joint_state(1, START)),
        (both.images, types.make(IMAGE, **IMAGE_FIELDS)),
    ]
    get = wire.key(0, "/tautscope/get_parameters", GET, types.type_hash(GET))
    attachment = wire.attachment(1, 2, b"c" * 16)
    replies = []
    for _ in range(150):
        for publisher, message in good:
            publisher.send(damaged(types.encode(message), random_))
        payload = damaged(types.encode(names), random_)
        send = {"payload": payload, "attachment": damaged(attachment, random_)}
        replies.append(both.other._session.get(get, **send))
        drive(both, 1)
    assert both.control.operating_state == "ENABLED"
    assert both.control.run.loop.supervision.flags == ()  # type: ignore[union-attr]
    answers = [reply.try_recv() for reply in replies]
    assert any(each is not None and each.err is not None for each in answers)
    assert {"/instrument/servo_jp", "/instrument/state_command"} <= {
        field.split()[0] for field in both.control._telemetry.refused
    }


def damaged(data: bytes, random_: random.Random) -> bytes:
    """A message with changed bytes, cut off."""
    found = bytearray(data)
    for _ in range(1 + random_.randrange(4)):
        found[random_.randrange(min(len(found), 120))] = random_.randrange(256)
    return bytes(found[: random_.randrange(len(found))])


def service(both: Peers, name: str, kind: str, request: object):
    """Call a service of the node under test as rmw_zenoh does."""
    key = wire.key(0, name, kind, types.type_hash(kind))
    replies = both.other._session.get(
        key, payload=types.encode(request), attachment=wire.attachment(1, 2, b"c" * 16)
    )
    both.delivered()
    for _ in range(200):
        both.control.serve()
        if (reply := replies.try_recv()) is not None:
            sequence, _, source = wire.read_attachment(reply.ok.attachment.to_bytes())
            assert (sequence, source) == (1, b"c" * 16)
            return types.decode(f"{kind}_Response", reply.ok.payload.to_bytes())
        time.sleep(0.01)
    raise AssertionError("no reply")
