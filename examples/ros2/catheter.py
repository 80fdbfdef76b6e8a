"""Motors and tracker of a catheter as a node of ROS 2: two bending planes, a pose of the tip.

It stands for the nodes of your motors and of your tracker: plays of 0.6 rad in place of both.

    tautscope ros2 --config examples/ros2/catheter.toml --driver --listen tcp/127.0.0.1:7447
    python examples/ros2/catheter.py
    python examples/ros2/input_device.py
"""

import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from tautscope import load_config
from tautscope.loop.kinematics import TwoPlanes
from tautscope.ros2 import messages, types
from tautscope.ros2.inputs import joint_positions
from tautscope.ros2.session import ROUTER, Node

CONFIG = load_config(Path(__file__).with_name("catheter.toml"))
NAMES = [dof.label for dof in CONFIG.dofs]
(TRACKER,) = CONFIG.measurement.topics
JOINTS, MSG = "sensor_msgs/msg/JointState", "geometry_msgs/msg"
POSE = f"{MSG}/PoseStamped"
PERIOD, HALF_WIDTH, POSE_EVERY = 0.005, 0.3, 5


def pose(stamp: int, position: np.ndarray, bend: np.ndarray) -> Any:
    """geometry_msgs/msg/PoseStamped of the tip of a section that is bent by (2,) [rad]."""
    angle = np.hypot(*bend)
    x, y = np.array([-bend[1], bend[0]]) / 2 * np.sinc(angle / math.tau)  # sin(angle / 2) / angle
    orientation = types.make(f"{MSG}/Quaternion", x=x, y=y, z=0.0, w=math.cos(angle / 2))
    place = types.make(f"{MSG}/Point", **dict(zip("xyz", position.tolist(), strict=True)))
    turned = types.make(f"{MSG}/Pose", position=place, orientation=orientation)
    return types.make(POSE, header=types.header(stamp, TRACKER.frame), pose=turned)


def main(endpoint: str = ROUTER) -> None:
    kinematics, rng = TwoPlanes(CONFIG), np.random.default_rng(1)
    motors = tip = np.zeros(2)
    with Node("catheter", connect=endpoint) as node:
        setpoints = node.subscription("/instrument/actuators/setpoint_js", JOINTS)
        positions = node.publisher("/instrument/actuators/measured_js", JOINTS)
        poses = node.publisher(TRACKER.name, POSE)
        ticks = 0
        while True:
            message = setpoints.take()
            if message is not None:  # your motors also stop by themselves: see driver.py
                motors = joint_positions(setpoints.topic, message, NAMES)
            tip = np.clip(tip, motors - HALF_WIDTH, motors + HALF_WIDTH)
            now = time.time_ns()
            positions.publish(messages.joint_state(now, NAMES, motors))
            if ticks % POSE_EVERY == 0:
                position = kinematics.tip(tip)[0] + rng.normal(0, 0.3e-3, 3)
                poses.publish(pose(now, position, tip))
            ticks += 1
            time.sleep(PERIOD)


if __name__ == "__main__":
    main(*sys.argv[1:])
