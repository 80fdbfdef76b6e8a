"""Messages of sensors as measurements; an error names topic and field."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tautscope.config import Config, DofEntry, KinematicsConfig, MeasurementConfig, TopicConfig
from tautscope.errors import ConfigError, MessageError
from tautscope.loop.measurement import Pose, Tip
from tautscope.ros2 import messages, types
from tautscope.ros2.measurements import KINDS, MeasurementReader

NAMES = ["bend_x", "bend_y"]
TOPIC = "/tracker"
TURNED = Rotation.from_rotvec([0.3, -0.8, 0.5])
QUATERNION = TURNED.as_quat()
POSITION = [0.01, -0.02, 0.07]


def config(kind: str, **changes: Any) -> Config:
    topic = TopicConfig(name=TOPIC, type=kind, **changes)
    return Config(
        dof=tuple(DofEntry(name=name, width_limit=1.0) for name in NAMES),
        kinematics=KinematicsConfig(kind="two_planes"),
        measurement=MeasurementConfig(topics=(topic,)),
    )


def geometry(name: str, **fields: Any) -> Any:
    return types.make(f"geometry_msgs/msg/{name}", **fields)


def message(
    kind: str,
    position: list[float] = POSITION,
    quaternion: Any = QUATERNION,
    covariance: Any = None,
    frame: str = "base",
) -> Any:
    """A message of a type, as it is received."""
    point = geometry("Point", **dict(zip("xyz", map(float, position), strict=True)))
    header = types.header(1, frame)
    if kind == "PointStamped":
        made = geometry(kind, header=header, point=point)
    else:
        turned = geometry("Quaternion", **dict(zip("xyzw", map(float, quaternion), strict=True)))
        pose = geometry("Pose", position=point, orientation=turned)
        if kind == "PoseWithCovarianceStamped":
            values = np.zeros(36) if covariance is None else np.ravel(covariance)
            pose = geometry("PoseWithCovariance", pose=pose, covariance=values)
        made = geometry(kind, header=header, pose=pose)
    return types.decode(KINDS[kind], types.encode(made))


def read(kind: str, **fields: Any) -> Any:
    return MeasurementReader(config(kind), 0, TOPIC).read(message(kind, **fields), 1.5)


@pytest.mark.parametrize("kind", ["PoseStamped", "PoseWithCovarianceStamped"])
def test_a_pose_is_read_with_the_rotation_of_its_quaternion(kind: str) -> None:
    found = read(kind)
    assert isinstance(found, Pose)
    assert (found.position == POSITION).all()
    np.testing.assert_allclose(found.orientation, TURNED.as_matrix(), atol=1e-12)
    assert (found.captured_at, found.covariance, found.sensor) == (1.5, None, 0)


def test_a_quaternion_that_is_nan_is_no_orientation() -> None:
    found = read("PoseWithCovarianceStamped", quaternion=[np.nan] * 4, covariance=np.eye(6) * 4e-6)
    assert found.orientation is None
    assert (found.covariance == np.eye(3) * 4e-6).all()
    assert read("PointStamped").orientation is None


def test_the_covariance_about_fixed_axes_is_turned_to_the_axes_of_the_sensor() -> None:
    """Errors about the fixed x axis alone are errors about this axis, seen from the sensor."""
    variances = np.diag([1e-6, 4e-6, 9e-6, 1e-2, 1e-8, 1e-8])
    found = read("PoseWithCovarianceStamped", covariance=variances).covariance
    np.testing.assert_allclose(found[:3, :3], variances[:3, :3], rtol=1e-12)
    values, axes = np.linalg.eigh(found[3:, 3:])
    np.testing.assert_allclose(values, [1e-8, 1e-8, 1e-2], rtol=1e-6)
    np.testing.assert_allclose(np.abs(axes[:, 2] @ TURNED.inv().apply([1, 0, 0])), 1.0, rtol=1e-9)


def test_a_covariance_that_is_equal_about_all_axes_stays_what_it_is() -> None:
    variances = np.diag([9e-8] * 3 + [1e-4] * 3)
    found = read("PoseWithCovarianceStamped", covariance=variances).covariance
    np.testing.assert_allclose(found, variances, atol=1e-19)


def test_joints_are_measured_by_their_names() -> None:
    reader = MeasurementReader(config("JointState"), 0, TOPIC)

    def tip(names: list[str], values: list[float]) -> Any:
        return reader.read(messages.joint_state(1, names, values), 1.5)

    assert tip(["bend_y", "bend_x"], [2.0, 1.0]).values.tolist() == [1.0, 2.0]
    found = tip(["bend_y"], [2.0])
    assert isinstance(found, Tip)
    np.testing.assert_array_equal(found.values, [np.nan, 2.0])
    np.testing.assert_array_equal(tip(NAMES, [1.0, np.nan]).values, [1.0, np.nan])
    assert tip(NAMES, [np.nan, np.nan]) is None
    for names, values, field in (
        (["bend_x", "bend_z"], [1.0, 2.0], "name"),
        (["bend_x", "bend_x"], [1.0, 2.0], "name"),
        ([], [], "name"),
        (NAMES, [1.0], "position"),
        (NAMES, [1.0, np.inf], "position of bend_y"),
    ):
        with pytest.raises(MessageError) as error:
            tip(names, values)
        assert error.value.field == f"{TOPIC} {field}"


@pytest.mark.parametrize(
    ("kind", "changes", "field"),
    [
        ("PoseStamped", {"quaternion": [0, 0, 0, 0]}, "pose.orientation"),
        ("PoseStamped", {"quaternion": [0, 0, 0, 1.1]}, "pose.orientation"),
        ("PoseStamped", {"quaternion": [0, 0, np.nan, 1]}, "pose.orientation"),
        ("PoseStamped", {"position": [0, np.inf, 0]}, "pose.position"),
        ("PointStamped", {"position": [0, np.inf, 0]}, "point"),
        ("PoseWithCovarianceStamped", {"quaternion": [1, 1, 0, 0]}, "pose.pose.orientation"),
        ("PoseWithCovarianceStamped", {"covariance": -np.eye(6)}, "pose.covariance"),
        ("PoseWithCovarianceStamped", {"covariance": np.full((6, 6), np.nan)}, "pose.covariance"),
    ],
)
def test_what_is_wrong_in_a_message_is_named(
    kind: str, changes: dict[str, Any], field: str
) -> None:
    with pytest.raises(MessageError) as error:
        read(kind, **changes)
    assert error.value.field == f"{TOPIC} {field}"


def test_messages_are_of_one_frame() -> None:
    reader = MeasurementReader(config("PoseStamped"), 0, TOPIC)
    assert reader.read(message("PoseStamped", frame="base"), 1.0) is not None
    with pytest.raises(MessageError, match=r"/tracker header\.frame_id: got 'tool', .*'base'"):
        reader.read(message("PoseStamped", frame="tool"), 2.0)
    reader = MeasurementReader(config("PoseStamped", frame="guide"), 0, TOPIC)
    with pytest.raises(MessageError, match="'guide'"):
        reader.read(message("PoseStamped", frame="base"), 1.0)


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"kinematics.kind": "joints"}, "kinematics.kind"),
        ({"dof": [], "kinematics": {}}, "measurement.topics"),
        ({"measurement.topics": [{"name": "a b", "type": "PoseStamped"}]}, "topics[0].name"),
        ({"measurement.topics": [{"name": "a", "type": "JointState"}] * 2}, "topics[1].name"),
        ({"measurement.topics": [{"name": "a", "type": "Image"}]}, "topics[0].type"),
    ],
)
def test_topics_that_cannot_measure_are_refused(changes: dict[str, Any], field: str) -> None:
    with pytest.raises(ConfigError) as error:
        config("PoseStamped").replace(**changes)
    assert error.value.field.endswith(field)
