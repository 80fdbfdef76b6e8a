"""Messages that the node publishes."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from tautscope.config import CameraConfig
from tautscope.log import fields
from tautscope.log.fields import header_of
from tautscope.loop.reduction import Report, Status
from tautscope.loop.rig import Frame
from tautscope.ros2 import types
from tautscope.ros2.inputs import ENCODINGS

LOST = (Status.NO_MARKERS, Status.STALE, Status.DUPLICATE, Status.REFUSED)
"""Updates that measured nothing."""


def joint_state(stamp: int, joints: Sequence[str], values: Iterable[float]) -> Any:
    """sensor_msgs/msg/JointState: positions (n,) [m or rad] at a wall clock time [ns]."""
    found = fields.joint_state(header_of(stamp, "guide"), joints, values)
    return types.make("sensor_msgs/msg/JointState", **found)


def tip_state(stamp: int, joints: Sequence[str], report: Report) -> Any:
    """sensor_msgs/msg/JointState: q_hat of an update; stamp 0 if nothing was measured (CRTK)."""
    return joint_state(0 if report.status in LOST else stamp, joints, report.state_estimate)


def image(stamp: int, frame: Frame, camera: CameraConfig) -> Any | None:
    """sensor_msgs/msg/Image of a frame; None if ROS has no encoding for the camera's format."""
    encodings = ENCODINGS.get(camera.pixel_format)
    if encodings is None:
        return None
    pixels = np.ascontiguousarray(frame.image)
    return types.make(
        "sensor_msgs/msg/Image",
        header=header_of(stamp, "endoscope"),
        height=camera.height,
        width=camera.width,
        encoding=encodings[0],
        step=pixels.strides[0],
        data=pixels.reshape(-1),
    )
