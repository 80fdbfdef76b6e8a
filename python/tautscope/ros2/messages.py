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
_NOTHING = np.empty(0)
LOST = (Status.NO_MARKERS, Status.STALE, Status.DUPLICATE, Status.REFUSED)
"""Updates that measured nothing."""


def joint_state(stamp: int, joints: Sequence[str], values: Iterable[float]) -> Any:
    """sensor_msgs/msg/JointState: positions (n,) [m or rad] at a wall clock time [ns]."""
    return types.make(
        "sensor_msgs/msg/JointState",
        header=types.header(stamp, "guide"),
        name=list(joints),
        position=np.asarray(values, np.float64),
        velocity=_NOTHING,
        effort=_NOTHING,
    )


def tip_state(stamp: int, joints: Sequence[str], report: Report) -> Any:
    """sensor_msgs/msg/JointState: q_hat of an update; stamp 0 if nothing was measured (CRTK)."""
    return joint_state(0 if report.status in LOST else stamp, joints, report.state_estimate)


def offsets(joints: Sequence[str], report: Report) -> Any:
    """std_msgs/msg/Float64MultiArray (n, 2): delta_minus and delta_plus of each DOF."""
    values = np.stack([report.delta_minus, report.delta_plus], axis=1).ravel()
    axes = ((",".join(joints), len(joints), 2 * len(joints)), ("minus,plus", 2, 2))
    dim = [
        types.make("std_msgs/msg/MultiArrayDimension", label=label, size=size, stride=stride)
        for label, size, stride in axes
    ]
    layout = types.make("std_msgs/msg/MultiArrayLayout", dim=dim, data_offset=0)
    return types.make("std_msgs/msg/Float64MultiArray", layout=layout, data=values)


def text(data: str) -> Any:
    """std_msgs/msg/String."""
    return types.make("std_msgs/msg/String", data=data)


def number(data: float) -> Any:
    """std_msgs/msg/Float64."""
    return types.make("std_msgs/msg/Float64", data=data)


def operating_state(stamp: int, state: str, *, is_homed: bool, is_busy: bool) -> Any:
    """crtk_msgs/msg/OperatingState."""
    return types.make(
        "crtk_msgs/msg/OperatingState",
        header=types.header(stamp, ""),
        state=state,
        is_homed=is_homed,
        is_busy=is_busy,
    )


def diagnostics(stamp: int, name: str, level: int, text: str, values: Mapping[str, object]) -> Any:
    """diagnostic_msgs/msg/DiagnosticArray of one status."""
    pairs = [
        types.make("diagnostic_msgs/msg/KeyValue", key=key, value=str(value))
        for key, value in values.items()
    ]
    status = types.make(
        "diagnostic_msgs/msg/DiagnosticStatus",
        level=level,
        name=name,
        message=text,
        hardware_id="tautscope",
        values=pairs,
    )
    return types.make(
        "diagnostic_msgs/msg/DiagnosticArray", header=types.header(stamp, ""), status=[status]
    )


def camera_info(stamp: int, camera: CameraConfig) -> Any:
    """sensor_msgs/msg/CameraInfo of the configured camera."""
    window = types.make(
        "sensor_msgs/msg/RegionOfInterest",
        x_offset=0,
        y_offset=0,
        height=0,
        width=0,
        do_rectify=False,
    )
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    return types.make(
        "sensor_msgs/msg/CameraInfo",
        header=types.header(stamp, "endoscope"),
        height=camera.height,
        width=camera.width,
        distortion_model="rational_polynomial",
        d=np.array(camera.distortion, np.float64),
        k=np.array([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        r=np.eye(3).ravel(),
        p=np.array([fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
        binning_x=0,
        binning_y=0,
        roi=window,
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
        is_bigendian=0,
        step=pixels.strides[0],
        data=pixels.reshape(-1),
    )
