"""Message fields that several topics share, in their ROS 2 types."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from tautscope.log.cdr import Message


def header_of(nanoseconds: int, frame: str) -> dict[str, Any]:
    """std_msgs/msg/Header for a wall clock time [ns]."""
    return {"stamp": stamp_of(nanoseconds), "frame_id": frame}


def stamp_of(nanoseconds: int) -> dict[str, int]:
    """builtin_interfaces/msg/Time for a wall clock time [ns]."""
    return {"sec": nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}


def joint_state(header: Message, names: list[str], values: Iterable[float]) -> dict[str, Any]:
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
