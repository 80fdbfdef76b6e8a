"""Received messages are checked; an error names topic and field."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from tautscope.config import CameraConfig, PixelFormat, load_config
from tautscope.errors import ConfigError, MessageError
from tautscope.ros2 import messages, types
from tautscope.ros2.inputs import (
    FUTURE,
    ImageReader,
    JoyAxes,
    Stamps,
    joint_positions,
    joy_deflection,
)

CAMERA = load_config().camera
NOW = 10**18
TOPIC = "/topic"
JOINTS = ["insertion", "rotation", "bending"]


def image(**changes: object):
    fields = {
        "header": types.header(NOW, "endoscope"),
        "height": CAMERA.height,
        "width": CAMERA.width,
        "encoding": "bgr8",
        "is_bigendian": 0,
        "step": 3 * CAMERA.width,
        "data": np.zeros(3 * CAMERA.width * CAMERA.height, np.uint8),
    }
    return types.make("sensor_msgs/msg/Image", **fields | changes)


def joints(**changes: object):
    message = messages.joint_state(NOW, JOINTS, [1.0, 2.0, 3.0])
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def joy(axes: list[float], buttons: list[int]):
    return types.make(
        "sensor_msgs/msg/Joy",
        header=types.header(NOW, ""),
        axes=np.array(axes, np.float32),
        buttons=np.array(buttons, np.int32),
    )


def test_joints_are_found_by_their_names() -> None:
    message = joints(name=["bending", "insertion", "rotation"])
    assert joint_positions(TOPIC, message, JOINTS).tolist() == [2.0, 3.0, 1.0]


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"name": []}, "name"),
        ({"name": ["insertion", "rotation"]}, "name"),
        ({"name": ["insertion", "rotation", "rotation"]}, "name"),
        ({"name": ["a", "b", "c"]}, "name"),
        ({"position": np.zeros(2)}, "position"),
        ({"position": np.array([0, np.nan, 0])}, "position of rotation"),
        ({"position": np.array([0, 0, np.inf])}, "position of bending"),
    ],
)
def test_wrong_joints_are_named(changes: dict[str, object], field: str) -> None:
    with pytest.raises(MessageError) as found:
        joint_positions(TOPIC, joints(**changes), JOINTS)
    assert found.value.field == f"{TOPIC} {field}"


@pytest.mark.parametrize("stamp", [0, NOW + FUTURE + 1])
def test_stamps_that_are_not_known_or_ahead_are_refused(stamp: int) -> None:
    with pytest.raises(MessageError, match=r"/topic header\.stamp"):
        Stamps(TOPIC).check(types.header(stamp, ""), NOW)


@given(st.lists(st.integers(1, NOW), min_size=1, max_size=20))
def test_only_later_stamps_pass(stamps: list[int]) -> None:
    checker, passed = Stamps(TOPIC), []
    for stamp in stamps:
        try:
            passed.append(checker.check(types.header(stamp, ""), NOW))
        except MessageError:
            assert stamp <= passed[-1]
    assert passed == sorted(set(passed))


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
@pytest.mark.parametrize("padding", [0, 8])
def test_an_image_is_read_as_it_was_sent(
    pixel_format: PixelFormat, encoding: str, shape: tuple[int, ...], padding: int
) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, shape, np.uint8)
    padded = np.pad(pixels.reshape(shape[0], -1), ((0, 0), (0, padding)))
    step, data = padded.shape[1], padded.reshape(-1)
    sent = image(height=4, width=6, encoding=encoding, step=step, data=data)
    received = types.decode("sensor_msgs/msg/Image", types.encode(sent))
    camera = CameraConfig(width=6, height=4, pixel_format=pixel_format)
    frame = ImageReader(TOPIC, camera).read(received, 1.5, 7)
    assert (frame.image == pixels).all()
    assert np.shares_memory(frame.image, received.data)
    assert (frame.captured_at, frame.sequence) == (1.5, 7)


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"encoding": "mono8"}, "encoding"),
        ({"encoding": "rgb8"}, "encoding"),
        ({"height": 10}, "height"),
        ({"width": 10}, "width"),
        ({"step": 3 * CAMERA.width - 1}, "step"),
        ({"data": np.zeros(5, np.uint8)}, "data"),
        ({"step": 2**32 - 1}, "data"),
    ],
)
def test_wrong_images_are_named(changes: dict[str, object], field: str) -> None:
    with pytest.raises(MessageError) as found:
        ImageReader(TOPIC, CAMERA).read(image(**changes), 0.0, 0)
    assert found.value.field == f"{TOPIC} {field}"


def test_a_format_that_ros_does_not_have_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"camera\.pixel_format"):
        ImageReader(TOPIC, load_config().replace(**{"camera.pixel_format": "i420"}).camera)


def test_axes_and_button_of_a_gamepad() -> None:
    message = joy([0.25, -0.5, 0, 0, 1.0], [0, 0, 0, 0, 1])
    deflection, is_holding = joy_deflection(TOPIC, message, JoyAxes())
    assert deflection.tolist() == [-0.5, 0.25, 1.0]
    assert is_holding


@pytest.mark.parametrize(
    ("axes", "buttons", "field"),
    [
        ([0.0] * 4, [0] * 5, "axes"),
        ([0.0] * 5, [0] * 4, "buttons"),
        ([0.0, 1.5, 0, 0, 0], [0] * 5, "axes"),
        ([0.0, np.nan, 0, 0, 0], [0] * 5, "axes"),
    ],
)
def test_wrong_gamepads_are_named(axes: list[float], buttons: list[int], field: str) -> None:
    with pytest.raises(MessageError) as found:
        joy_deflection(TOPIC, joy(axes, buttons), JoyAxes())
    assert found.value.field == f"{TOPIC} {field}"


@given(
    st.lists(st.text(max_size=12), max_size=5),
    hnp.arrays(np.float64, st.integers(0, 5), elements=st.floats(allow_nan=True)),
)
def test_any_joints_are_read_or_refused(names: list[str], position: np.ndarray) -> None:
    try:
        found = joint_positions(TOPIC, joints(name=names, position=position), JOINTS)
    except MessageError:
        return
    assert np.isfinite(found).all()
