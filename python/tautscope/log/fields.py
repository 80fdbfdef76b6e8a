"""Fields of messages that logs and the ROS 2 node have, in their ROS 2 types."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from tautscope.config import CameraConfig
from tautscope.log.cdr import Message
from tautscope.loop.reduction import Report

LONGEST = 2.0**31 - 1
"""Largest time that a builtin_interfaces/msg/Time states [s since 1970]: a rig may give any."""


def nanoseconds_of(seconds: float) -> int:
    """A time span in [ns], within +-`LONGEST`."""
    return round(min(max(seconds, -LONGEST), LONGEST) * 1e9)


def header_of(nanoseconds: int, frame: str) -> dict[str, Any]:
    """std_msgs/msg/Header for a wall clock time [ns]."""
    return {"stamp": stamp_of(nanoseconds), "frame_id": frame}


def stamp_of(nanoseconds: int) -> dict[str, int]:
    """builtin_interfaces/msg/Time for a wall clock time [ns], the nearest that it can state."""
    sec, nanosec = divmod(min(max(nanoseconds, 0), nanoseconds_of(LONGEST)), 10**9)
    return {"sec": sec, "nanosec": nanosec}


def joint_state(header: Message, names: Sequence[str], values: Iterable[float]) -> dict[str, Any]:
    """sensor_msgs/msg/JointState: positions (n,) [m or rad] of the degrees of freedom."""
    position = [float(value) for value in values]
    return {"header": header, "name": names, "position": position}


def multi_array(axes: Mapping[str, int], data: Iterable[Any]) -> dict[str, Any]:
    """std_msgs/msg/Float64MultiArray from the label and length of each axis, and the data."""
    sizes = list(axes.values())
    dim = [
        {"label": label, "size": size, "stride": int(np.prod(sizes[place:]))}
        for place, (label, size) in enumerate(axes.items())
    ]
    return {"layout": {"dim": dim}, "data": [float(value) for value in data]}


def offsets(names: Sequence[str], report: Report) -> dict[str, Any]:
    """std_msgs/msg/Float64MultiArray (n, 2): delta_minus and delta_plus of each DOF."""
    values = np.stack([report.delta_minus, report.delta_plus], axis=1).ravel()
    return multi_array({",".join(names): len(names), "minus,plus": 2}, values)


def diagnostics(header: Message, values: Mapping[str, object], **status: Any) -> dict[str, Any]:
    """diagnostic_msgs/msg/DiagnosticArray of one status, from its values and other fields."""
    status["values"] = [{"key": key, "value": str(value)} for key, value in values.items()]
    return {"header": header, "status": [status]}


def camera_info(stamp: int, camera: CameraConfig) -> dict[str, Any]:
    """sensor_msgs/msg/CameraInfo of the configured camera."""
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx, camera.cy
    return {
        "header": header_of(stamp, "endoscope"),
        "height": camera.height,
        "width": camera.width,
        "distortion_model": "rational_polynomial",
        "d": camera.distortion,
        "k": [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        "r": np.eye(3).ravel(),
        "p": [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    }
