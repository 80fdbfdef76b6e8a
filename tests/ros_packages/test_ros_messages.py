"""Messages of other nodes, with test doubles of the message types."""

from types import SimpleNamespace as Message

import pytest
from tautscope.config import CameraConfig, Config, load_config
from tautscope_node import messages

JOINTS = ["insertion", "rotation", "bending"]


def test_positions_are_taken_by_name_and_else_by_order():
    named = Message(
        name=["bending", "gripper", "insertion", "rotation"], position=[3.0, 9.0, 1.0, 2.0]
    )
    assert messages.positions(named, JOINTS).tolist() == [1.0, 2.0, 3.0]
    assert messages.positions(Message(name=[], position=[1.0, 2.0, 3.0]), JOINTS).tolist() == [
        1,
        2,
        3,
    ]


@pytest.mark.parametrize(
    "message",
    [
        Message(name=[], position=[1.0, 2.0]),
        Message(name=JOINTS, position=[1.0, 2.0]),
        Message(name=["insertion", "rotation", "yaw"], position=[1.0, 2.0, 3.0]),
        Message(name=[], position=[]),
    ],
)
def test_a_message_without_all_joints_has_no_positions(message):
    assert messages.positions(message, JOINTS) is None


@pytest.mark.parametrize("joints", [[], JOINTS[:2], ["a", "a", "b"]])
def test_joints_are_different_names_one_per_degree_of_freedom(joints):
    with pytest.raises(ValueError, match="expected 3 different names"):
        messages.joints_of(joints, Config())


def test_joints_of_another_robot_are_its_degrees_of_freedom_or_named():
    config = load_config("colonoscope")
    assert messages.joints_of(JOINTS, config) == ["bend_x", "bend_y", "insertion"]
    assert messages.joints_of(["a", "b", "c"], config) == ["a", "b", "c"]
    with pytest.raises(ValueError, match="of bend_x, bend_y, insertion, got a, b"):
        messages.joints_of(["a", "b"], config)


def test_another_calibration_is_named():
    camera = CameraConfig()
    k = [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1]
    assert messages.calibration_problem(Message(width=720, height=576, k=k), camera) == ""
    assert messages.calibration_problem(Message(width=720, height=576, k=[0.0] * 9), camera) == ""
    assert "640 x 480" in messages.calibration_problem(Message(width=640, height=480, k=k), camera)
    k[0] += 20
    assert "fx" in messages.calibration_problem(Message(width=720, height=576, k=k), camera)
