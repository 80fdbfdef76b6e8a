"""Messages of other nodes, with test doubles of the message types."""

from types import SimpleNamespace as Message

import pytest
from tautscope.config import CameraConfig
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
def test_joints_are_three_different_names(joints):
    with pytest.raises(ValueError, match="expected three different names"):
        messages.check_joints(joints)


def test_another_calibration_is_named():
    camera = CameraConfig()
    k = [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1]
    assert messages.calibration_problem(Message(width=720, height=576, k=k), camera) == ""
    assert messages.calibration_problem(Message(width=720, height=576, k=[0.0] * 9), camera) == ""
    assert "640 x 480" in messages.calibration_problem(Message(width=640, height=480, k=k), camera)
    k[0] += 20
    assert "fx" in messages.calibration_problem(Message(width=720, height=576, k=k), camera)
