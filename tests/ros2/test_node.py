"""The node: states, references, silence, refusals, and what it publishes."""

from __future__ import annotations

import random
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from ros2.lockstep import JOINTS, Peers, compare, peers
from tautscope.config import load_config
from tautscope.log import cdr
from tautscope.log.reader import read_log
from tautscope.log.replay import replay_same
from tautscope.ros2 import messages, types, wire
from tautscope.ros2.lifecycle import State
from tautscope.ros2.wire import Qos

CONFIG = load_config()
START = np.array([0.025, 0.0, 0.9])
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


def drive(both: Peers, ticks: int, speed: float = 0.0, *, at: np.ndarray = START) -> np.ndarray:
    """Stream references that move insertion at a speed [m/s]; returns the last one."""
    reference = at.copy()

    def send() -> None:
        nonlocal reference
        both.send_position(START)
        both.send_reference(reference)
        both.delivered()
        reference = reference + np.array([speed * 5e-3, 0, 0])

    both.clock.before_tick = send
    for _ in range(ticks):
        both.tick()
    return reference - np.array([speed * 5e-3, 0, 0])


def rest(both: Peers, ticks: int) -> None:
    """Ticks without a reference; the driver goes on."""

    def send() -> None:
        both.send_position(START)
        both.delivered()

    both.clock.before_tick = send
    for _ in range(ticks):
        both.tick()


def commands(both: Peers) -> np.ndarray:
    return np.array([message.position for message in both.drain(both.commands)])


@pytest.mark.parametrize("profile", ["best", "paper"])
def test_commands_have_the_bits_of_the_python_loop(tmp_path: Path, profile: str) -> None:
    config = load_config(None, profile)
    found = compare(config, tmp_path, 4.0, seed=3, shares=[(2.0, 0.5), (3.0, 1.0)])
    assert found.ticks == 800
    assert found.different == 0
    assert found.updates >= found.images - 1 >= 95
    assert found.missed == 0
    assert found.travel.min() > 0.01
    same, _ = replay_same(read_log(found.log))
    assert same.is_identical
    assert same.ticks == 800


def test_a_stream_that_begins_at_the_set_point_is_followed_bit_for_bit(both: Peers) -> None:
    both.control.parameters._parameters["compensation"].value = 0.0  # the command is the reference
    both.enable(START)
    last = drive(both, 100, 0.01)
    drive(both, 1, 0.0, at=last)
    assert (commands(both)[-1] == last).all()


def test_the_first_of_several_waiting_references_clutches_in(both: Peers) -> None:
    both.control.parameters._parameters["compensation"].value = 0.0
    both.enable(START)
    for step in range(3):
        both.clock.now += 1
        both.send_reference(START + np.array([step * 1e-5, 0, 0]))
    both.delivered()
    rest(both, 1)
    assert (commands(both)[-1] == START + np.array([2e-5, 0, 0])).all()


def test_a_stream_that_begins_elsewhere_moves_nothing_at_first(both: Peers) -> None:
    both.enable(START)
    drive(both, 20, 0.0, at=START + np.array([0.01, 1.0, 0.2]))
    assert np.ptp(commands(both), axis=0).max() == 0
    assert both.control.operating_state == "ENABLED"


def test_a_silent_device_stops_motion_until_it_is_resumed(both: Peers) -> None:
    both.enable(START)
    last = drive(both, 200, 0.01)
    commands(both)
    rest(both, 60)
    silent = commands(both)
    changes = np.flatnonzero(np.ptp(np.diff(silent, axis=0), axis=1))
    stopped = 1 + (changes.max() if len(changes) else 0)
    assert stopped * CONFIG.control.period <= 0.1
    assert both.control.operating_state == "PAUSED"
    assert any("reference_late" in each.data for each in both.drain(both.warnings))
    last = drive(
        both, 20, 0.01, at=last + np.array([0.003, 0, 0])
    )  # the device alone does not resume
    assert np.ptp(commands(both), axis=0).max() == 0
    both.request("resume")
    drive(both, 40, 0.01, at=last)
    moved = commands(both)
    assert both.control.operating_state == "ENABLED"
    assert moved[-1, 0] > moved[0, 0]
    assert np.abs(np.diff(moved[:, 0])).max() < 0.4 * 5e-3  # no jump by what it moved meanwhile


def test_a_second_publisher_is_refused_until_it_takes_over(both: Peers) -> None:
    second = both.publisher("/instrument/servo_jp", JOINTS)
    both.delivered()
    both.enable(START)
    last = drive(both, 50, 0.01)

    def send() -> None:
        both.send_position(START)
        second.publish(messages.joint_state(both.clock.wall(), last - 0.01))
        both.delivered()

    both.clock.before_tick = send
    both.tick()  # takes the last of the first publisher
    before = both.control.run.reference.copy()  # type: ignore[union-attr]
    for _ in range(5):
        both.tick()
    assert (both.control.run.reference == before).all()  # type: ignore[union-attr]
    shown = [each.data for each in both.drain(both.warnings)]
    assert any(text.startswith("refused: /instrument/servo_jp publisher") for text in shown)
    both.request("resume")
    for _ in range(5):
        both.tick()
    assert both.control.operating_state == "ENABLED"
    assert both.control.run.reference is not None  # type: ignore[union-attr]
    assert both.control._source.age is not None  # it is followed


def test_late_references_move_nothing(both: Peers) -> None:
    both.enable(START)
    drive(both, 20)

    def send() -> None:
        both.send_position(START)
        late = both.clock.wall() - 60_000_000
        both.servo.publish(messages.joint_state(late, START + np.array([0.001, 0, 0])))
        both.delivered()

    commands(both)
    both.clock.before_tick = send
    for _ in range(30):
        both.tick()
    assert np.ptp(commands(both), axis=0).max() == 0
    assert both.control.operating_state == "PAUSED"


def test_pause_and_disable_stop_motion(both: Peers) -> None:
    both.enable(START)
    last = drive(both, 50, 0.01)
    both.request("pause")
    assert both.control.operating_state == "PAUSED"
    drive(both, 1, 0.01, at=last)
    commands(both)
    drive(both, 20, 0.01, at=last)
    assert np.ptp(commands(both), axis=0).max() == 0
    both.request("disable")
    assert both.control.operating_state == "DISABLED"
    assert both.control.lifecycle.state is State.INACTIVE
    assert [each.state for each in both.drain(both.states)][-1] == "DISABLED"


def test_a_driver_that_is_silent_is_a_fault(both: Peers) -> None:
    both.enable(START)
    drive(both, 10)
    both.clock.before_tick = lambda: None
    for _ in range(25):
        if both.control.run is not None:
            both.tick()
    assert both.control.operating_state == "FAULT"
    assert "/instrument/actuators/measured_js" in both.control.fault
    commands(both)
    both.control.serve()
    assert not len(commands(both))  # no set-point, by which the driver stops


def test_a_missing_driver_is_named(both: Peers) -> None:
    both.request("enable")
    assert both.control.run is None
    assert both.control.operating_state == "FAULT"
    assert "Start the driver" in both.control.fault


def test_enable_changes_nothing_while_enabled(both: Peers) -> None:
    both.enable(START)
    run = both.control.run
    drive(both, 5)
    both.request("enable")
    assert both.control.run is run
    assert both.control.lifecycle.state is State.ACTIVE


def test_unknown_commands_are_refused(both: Peers) -> None:
    both.request("home")
    (warning,) = both.drain(both.warnings)
    assert "/instrument/state_command string: got 'home'" in warning.data


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"position": np.array([np.nan, 0, 0])}, "position of insertion"),
        ({"name": ["a", "b", "c"]}, "name"),
        ({"header": types.header(0, "")}, "header.stamp"),
    ],
)
def test_a_malformed_reference_changes_nothing(
    both: Peers, changes: dict[str, object], field: str
) -> None:
    both.enable(START)
    drive(both, 50, 0.01)

    def send() -> None:
        both.send_position(START)
        message = messages.joint_state(both.clock.wall(), START + 0.5)
        for name, value in changes.items():
            setattr(message, name, value)
        both.servo.publish(message)
        both.servo.send(b"\x00\x01\x00\x00nonsense")
        both.delivered()

    both.clock.before_tick = send
    both.tick()  # takes the last good one
    before = both.control.run.reference.copy()  # type: ignore[union-attr]
    both.tick()
    assert (both.control.run.reference == before).all()  # type: ignore[union-attr]
    shown = [each.data for each in both.drain(both.warnings)]
    assert any(text.startswith(f"refused: /instrument/servo_jp {field}") for text in shown)
    assert any("little-endian CDR" in text for text in shown)
    drive(both, 5, 0.01, at=before)
    assert both.control.operating_state == "ENABLED"


def test_the_tip_has_stamp_0_while_markers_are_lost(both: Peers) -> None:
    tips = both.other.subscription("/instrument/measured_js", JOINTS, Qos(depth=100))
    offsets = both.other.subscription(
        "/instrument/hysteresis/delta", "std_msgs/msg/Float64MultiArray"
    )
    both.delivered(resend=True)
    both.enable(START)
    camera = CONFIG.camera
    rng = np.random.default_rng(1)

    def send() -> None:
        both.send_position(START)
        both.send_reference(START)
        pixels = rng.integers(40, 60, (camera.height, camera.width, 3), np.uint8)
        image = types.make(
            "sensor_msgs/msg/Image",
            header=types.header(both.clock.wall(), "endoscope"),
            height=camera.height,
            width=camera.width,
            encoding="bgr8",
            is_bigendian=0,
            step=3 * camera.width,
            data=pixels.reshape(-1),
        )
        both.images.publish(image)
        both.delivered()

    both.clock.before_tick = send
    for _ in range(6):
        both.tick()
    found = both.drain(tips)
    assert len(found) >= 3
    assert all((tip.header.stamp.sec, tip.header.stamp.nanosec) == (0, 0) for tip in found)
    assert all(tip.name == ["insertion", "rotation", "bending"] for tip in found)
    (delta,) = both.drain(offsets)
    assert [each.size for each in delta.layout.dim] == [3, 2]


def test_what_is_published_is_decoded_by_our_other_decoder(both: Peers) -> None:
    diagnostics = both.other.subscription("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    both.delivered(resend=True)
    both.clock.now += 2 * 10**9
    both.control.serve()
    message = both.received(diagnostics, "diagnostics")
    found = cdr.decode("diagnostic_msgs/msg/DiagnosticArray", types.encode(message))
    (status,) = found["status"]
    assert (status["name"], status["message"]) == ("tautscope", "DISABLED")


class Gamepad:
    """Publishes deflections of a gamepad."""

    def __init__(self, both: Peers) -> None:
        self._both = both
        self._joy = both.publisher("/joy", "sensor_msgs/msg/Joy")
        both.delivered(resend=True)

    def drive(self, ticks: int, deflection: float | None, *, is_holding: bool = True) -> np.ndarray:
        """Ticks with a deflection of insertion; None is silence."""
        both = self._both

        def send() -> None:
            both.send_position(START)
            if deflection is not None:
                axes = np.array([0, deflection, 0, 0, 0], np.float32)
                buttons = np.array([0, 0, 0, 0, is_holding], np.int32)
                stamp = types.header(both.clock.wall(), "")
                kind = "sensor_msgs/msg/Joy"
                self._joy.publish(types.make(kind, header=stamp, axes=axes, buttons=buttons))
            both.delivered()

        commands(both)
        both.clock.before_tick = send
        for _ in range(ticks):
            both.tick()
        return commands(both)[:, 0]


@pytest.fixture
def with_joy(tmp_path: Path) -> Iterator[Peers]:
    with peers(CONFIG, tmp_path, device="joy") as found:
        yield found


def test_a_gamepad_moves_only_while_its_button_is_held(with_joy: Peers) -> None:
    gamepad = Gamepad(with_joy)
    with_joy.enable(START)
    assert np.ptp(gamepad.drive(20, 1.0)) == 0  # held from the start: it must be released once
    assert np.ptp(gamepad.drive(5, 0.0, is_holding=False)) == 0
    assert np.ptp(gamepad.drive(60, 1.0)) > 1e-4
    gamepad.drive(2, 1.0, is_holding=False)
    assert np.ptp(gamepad.drive(20, 1.0, is_holding=False)) == 0


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
