"""Messages of ROS 2 as measurements of the tip; without ROS, for every node."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from tautscope.config import Config, TopicConfig
from tautscope.errors import MessageError, SignalError
from tautscope.loop.kinematics import Floats
from tautscope.loop.measurement import Measurement, Pose, Tip, check_rotation
from tautscope.loop.signal_checks import check_covariance
from tautscope.ros2.inputs import known_positions

KINDS = {
    "JointState": "sensor_msgs/msg/JointState",
    "PointStamped": "geometry_msgs/msg/PointStamped",
    "PoseStamped": "geometry_msgs/msg/PoseStamped",
    "PoseWithCovarianceStamped": "geometry_msgs/msg/PoseWithCovarianceStamped",
}
"""`measurement.topics[].type` -> type of ROS."""


class MeasurementReader:
    """Reads the messages of one of `measurement.topics`, whose index is that of the sensor."""

    def __init__(self, config: Config, sensor: int, topic: str) -> None:
        self._settings: TopicConfig = config.measurement.topics[sensor]
        self._joints = [dof.label for dof in config.dofs]
        self._sensor, self._topic = sensor, topic
        self.reset()

    def reset(self) -> None:
        """Take the frame of the next message, unless one is configured."""
        self._frame = self._settings.frame

    def read(self, message: Any, captured_at: float) -> Measurement | None:
        """The measurement of a message, of a time of the rig's clock [s]; None if it is all NaN.

        Raises:
            MessageError: Wrong are the frame, the names, a quaternion, a number or the covariance.
        """
        topic = self._topic
        if self._settings.type == "JointState":
            values = known_positions(topic, message, self._joints)
            return None if np.isnan(values).all() else Tip(values, captured_at, None, self._sensor)
        frame = message.header.frame_id
        self._frame = self._frame or frame
        if frame != self._frame:
            allowed = f"{self._frame!r}, in which the kinematics gives the tip"
            raise MessageError(f"{topic} header.frame_id", frame[:64], allowed)
        if self._settings.type == "PointStamped":
            return self._pose("point", message.point, None, captured_at, None)
        covariance = None
        pose, field = message.pose, "pose"
        if self._settings.type == "PoseWithCovarianceStamped":
            known = np.reshape(np.asarray(pose.covariance, np.float64), (6, 6))
            covariance = known if known.any() else None  # all zeros mark an unknown one
            pose, field = pose.pose, "pose.pose"
        turned = self._rotation(f"{field}.orientation", pose.orientation)
        return self._pose(f"{field}.position", pose.position, turned, captured_at, covariance)

    def _rotation(self, field: str, quaternion: Any) -> Floats | None:
        """Rotation matrix (3, 3) of a quaternion; None where it is all NaN."""
        values = np.array([getattr(quaternion, name) for name in "xyzw"], np.float64)
        if np.isnan(values).all():
            return None
        return self._checked(field, partial(check_rotation, values))

    def _pose(
        self,
        field: str,
        point: Any,
        rotation: Floats | None,
        captured_at: float,
        covariance: Floats | None,
    ) -> Pose | None:
        position = np.array([point.x, point.y, point.z], np.float64)
        if np.isinf(position).any():
            allowed = "finite numbers [m], or NaN for what was not measured"
            raise MessageError(f"{self._topic} {field}", position.tolist(), allowed)
        if np.isnan(position).all():
            return None
        if covariance is not None:
            # About fixed axes in ROS, about the sensor's in the loop: only a turn in between.
            turn = np.eye(6)
            turn[3:, 3:] = np.eye(3) if rotation is None else rotation.T
            known = turn @ covariance @ turn.T
            count = 3 if rotation is None else 6
            check = partial(check_covariance, "covariance", known[:count, :count], count)
            covariance = self._checked("pose.covariance", check)
        return Pose(position, captured_at, rotation, covariance, self._sensor)

    def _checked(self, field: str, check: Callable[[], Floats]) -> Floats:
        try:
            return check()
        except SignalError as error:
            field = f"{self._topic} {field}"
            raise MessageError(field, error.value, error.allowed) from None
