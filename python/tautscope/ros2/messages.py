"""Messages that the node publishes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from tautscope.config import CameraConfig
from tautscope.loop.reduction import Report, Status
from tautscope.loop.rig import Frame
from tautscope.ros2 import types
from tautscope.ros2.inputs import ENCODINGS

OK, WARN, ERROR = 0, 1, 2
"""Levels of diagnostic_msgs/msg/DiagnosticStatus."""
LOST = (Status.NO_MARKERS, Status.STALE, Status.DUPLICATE, Status.REFUSED)
"""Updates that measured nothing."""


def joint_state(stamp: int, joints: Sequence[str], values: Iterable[float]) -> Any:
    """sensor_msgs/msg/JointState: positions (n,) [m or rad] at a wall clock time [ns]."""
    return types.make(
        "sensor_msgs/msg/JointState",
        header=types.header(stamp, "guide"),
        name=joints,
        position=values,
    )


def tip_state(stamp: int, joints: Sequence[str], report: Report) -> Any:
    """sensor_msgs/msg/JointState: q_hat of an update; stamp 0 if nothing was measured (CRTK)."""
    return joint_state(0 if report.status in LOST else stamp, joints, report.state_estimate)


def offsets(joints: Sequence[str], report: Report) -> Any:
    """std_msgs/msg/Float64MultiArray (n, 2): delta_minus and delta_plus of each DOF."""
    count = len(joints)
    dim = [
        {"label": ",".join(joints), "size": count, "stride": 2 * count},
        {"label": "minus,plus", "size": 2, "stride": 2},
    ]
    values = np.stack([report.delta_minus, report.delta_plus], axis=1).ravel()
    return types.make("std_msgs/msg/Float64MultiArray", layout={"dim": dim}, data=values)


def text(data: str) -> Any:
    """std_msgs/msg/String."""
    return types.make("std_msgs/msg/String", data=data)


def number(data: float) -> Any:
    """std_msgs/msg/Float64."""
    return types.make("std_msgs/msg/Float64", data=data)


def operating_state(stamp: int, state: str, *, is_homed: bool, is_busy: bool) -> Any:
    """crtk_msgs/msg/OperatingState."""
    header = types.header(stamp, "")
    kind = "crtk_msgs/msg/OperatingState"
    return types.make(kind, header=header, state=state, is_homed=is_homed, is_busy=is_busy)


def diagnostics(stamp: int, name: str, level: int, text: str, values: Mapping[str, object]) -> Any:
    """diagnostic_msgs/msg/DiagnosticArray of one status."""
    status = {
        "level": level,
        "name": name,
        "message": text,
        "hardware_id": "tautscope",
        "values": [{"key": key, "value": str(value)} for key, value in values.items()],
    }
    kind = "diagnostic_msgs/msg/DiagnosticArray"
    return types.make(kind, header=types.header(stamp, ""), status=[status])


def camera_info(stamp: int, camera: CameraConfig) -> Any:
    """sensor_msgs/msg/CameraInfo of the configured camera."""
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    return types.make(
        "sensor_msgs/msg/CameraInfo",
        header=types.header(stamp, "endoscope"),
        height=camera.height,
        width=camera.width,
        distortion_model="rational_polynomial",
        d=camera.distortion,
        k=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r=np.eye(3).ravel(),
        p=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


def image(stamp: int, frame: Frame, camera: CameraConfig) -> Any | None:
    """sensor_msgs/msg/Image of a frame; None if ROS has no encoding for the camera's format."""
    encodings = ENCODINGS.get(camera.pixel_format)
    if encodings is None:
        return None
    pixels = np.ascontiguousarray(frame.image)
    return types.make(
        "sensor_msgs/msg/Image",
        header=types.header(stamp, "endoscope"),
        height=camera.height,
        width=camera.width,
        encoding=encodings[0],
        step=pixels.strides[0],
        data=pixels.reshape(-1),
    )
