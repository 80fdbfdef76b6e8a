"""Messages of other nodes, with test doubles of the message types."""

from types import SimpleNamespace as Message

import numpy as np
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


def image(array, encoding, padding=0, height=None):
    rows = array.reshape(array.shape[0], -1)
    padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=255)
    return Message(
        encoding=encoding,
        width=array.shape[1],
        height=height or array.shape[0],
        step=padded.shape[1],
        data=padded.tobytes(),
    )


@pytest.mark.parametrize("padding", [0, 16])
@pytest.mark.parametrize(
    ("pixel_format", "encoding", "shape"),
    [
        ("bgr", "bgr8", (4, 6, 3)),
        ("rgb", "rgb8", (4, 6, 3)),
        ("bgra", "bgra8", (4, 6, 4)),
        ("yuyv", "yuv422_yuy2", (4, 6, 2)),
        ("uyvy", "uyvy", (4, 6, 2)),
        ("nv12", "nv12", (6, 6)),
    ],
)
def test_pixels_are_those_of_the_message(pixel_format, encoding, shape, padding):
    array = np.random.default_rng(5).integers(0, 256, shape, np.uint8)
    camera = CameraConfig(width=6, height=4, pixel_format=pixel_format)
    found = messages.pixels(image(array, encoding, padding, height=4), camera)
    assert (found == array).all()


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"encoding": "mono8"}, "encoding mono8: expected bgr8"),
        ({"width": 5}, "5 x 4 px: expected 6 x 4 px"),
        ({"step": 17}, "step 17"),
        ({"data": b"1234"}, "4 bytes"),
    ],
)
def test_another_image_is_refused_with_its_difference(change, text):
    message = image(np.zeros((4, 6, 3), np.uint8), "bgr8")
    vars(message).update(change)
    with pytest.raises(ValueError, match=text):
        messages.pixels(message, CameraConfig(width=6, height=4))


def test_another_calibration_is_named():
    camera = CameraConfig()
    k = [camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1]
    assert messages.calibration_problem(Message(width=720, height=576, k=k), camera) == ""
    assert messages.calibration_problem(Message(width=720, height=576, k=[0.0] * 9), camera) == ""
    assert "640 x 480" in messages.calibration_problem(Message(width=640, height=480, k=k), camera)
    k[0] += 20
    assert "fx" in messages.calibration_problem(Message(width=720, height=576, k=k), camera)
