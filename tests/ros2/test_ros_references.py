"""References of the node: clutching, silence, a second publisher, refusals, a gamepad."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from driving import START, commands, drive, rest
from ros2.peers import JOINTS, Peers, peers
from service_client import Client
from tautscope.config import load_config
from tautscope.ros2 import messages, types

CONFIG = load_config()


def test_a_stream_that_begins_at_the_set_point_is_followed_bit_for_bit(
    both: Peers, client: Client
) -> None:
    client.set_parameters(("compensation", 0.0))  # the command is the reference
    both.enable(START)
    last = drive(both, 100, 0.01)
    drive(both, 1, 0.0, at=last)
    assert (commands(both)[-1] == last).all()


def test_the_first_of_several_waiting_references_clutches_in(both: Peers, client: Client) -> None:
    client.set_parameters(("compensation", 0.0))
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
    second = both.other.publisher("/instrument/servo_jp", JOINTS)
    both.delivered()
    both.enable(START)
    position = drive(both, 50, 0.01) - 0.01

    def send() -> None:
        position[0] += 1e-5
        both.send_position(START)
        second.publish(messages.joint_state(both.clock.wall(), both.joints, position))
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
    commands(both)
    for _ in range(20):
        both.tick()
    assert both.control.operating_state == "ENABLED"
    assert np.ptp(commands(both)[:, 0]) > 1e-4  # the second one is followed


def test_late_references_move_nothing(both: Peers) -> None:
    both.enable(START)
    drive(both, 20)

    def send() -> None:
        both.send_position(START)
        late = both.clock.wall() - 60_000_000
        position = START + np.array([0.001, 0, 0])
        both.servo.publish(messages.joint_state(late, both.joints, position))
        both.delivered()

    commands(both)
    both.clock.before_tick = send
    for _ in range(30):
        both.tick()
    assert np.ptp(commands(both), axis=0).max() == 0
    assert both.control.operating_state == "PAUSED"


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
        message = messages.joint_state(both.clock.wall(), both.joints, START + 0.5)
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


class Gamepad:
    """Publishes deflections of a gamepad."""

    def __init__(self, both: Peers) -> None:
        self._both = both
        self._joy = both.other.publisher("/joy", "sensor_msgs/msg/Joy")
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
                self._joy.publish({"header": stamp, "axes": axes, "buttons": buttons})
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
