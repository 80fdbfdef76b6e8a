"""Writes ROS 2 bags with rosbags' own Writer."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

TYPES = get_typestore(Stores.ROS2_JAZZY)
START = 1_763_000_000 * 10**9
STORAGES = {"mcap": StoragePlugin.MCAP, "db3": StoragePlugin.SQLITE3}


def make(kind: str, **fields: Any) -> Any:
    return TYPES.types[kind](**fields)


def header(stamp: int | None, frame: str = "base") -> Any:
    sec, nanosec = divmod(stamp or 0, 10**9)
    time = make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
    return make("std_msgs/msg/Header", stamp=time, frame_id=frame)


def vector(kind: str, values: Iterable[float]) -> Any:
    return make(f"geometry_msgs/msg/{kind}", **dict(zip("xyzw", map(float, values))))  # noqa: B905


def pose(position: Iterable[float], rotation: Iterable[float] = (0, 0, 0, 1)) -> Any:
    return make(
        "geometry_msgs/msg/Pose",
        position=vector("Point", position),
        orientation=vector("Quaternion", rotation),
    )


def joint_state(stamp: int | None, joints: dict[str, float]) -> Any:
    return make(
        "sensor_msgs/msg/JointState",
        header=header(stamp),
        name=list(joints),
        position=np.array(list(joints.values())),
        velocity=np.array([]),
        effort=np.array([]),
    )


def pose_stamped(stamp: int | None, position: Iterable[float], *rotation: Iterable[float]) -> Any:
    return make(
        "geometry_msgs/msg/PoseStamped", header=header(stamp), pose=pose(position, *rotation)
    )


def write_bag(folder: Path, storage: str, topics: dict[str, list[tuple[int, Any]]]) -> Path:
    """Topic -> recorded time [ns] and message, in the order of time over all topics."""
    with Writer(folder, version=9, storage_plugin=STORAGES[storage]) as bag:
        kinds = {topic: rows[0][1].__msgtype__ for topic, rows in topics.items()}
        open_topics = {
            topic: bag.add_connection(topic, kind, typestore=TYPES) for topic, kind in kinds.items()
        }
        rows = [(time, topic, each) for topic, some in topics.items() for time, each in some]
        for time, topic, each in sorted(rows, key=lambda row: row[0]):
            data = TYPES.serialize_cdr(each, kinds[topic])
            bag.write(open_topics[topic], time, data)
    return folder
