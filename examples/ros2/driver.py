"""A driver of ROS 2 without a ROS installation, with the watchdog that every driver needs.

It stands for the node of your motors: replace `Motors`.

    tautscope ros2 --driver --listen tcp/127.0.0.1:7447
    python examples/ros2/driver.py
"""

import json
import sys
import time
from collections.abc import Sequence

from tautscope.ros2 import messages
from tautscope.ros2.inputs import joint_positions
from tautscope.ros2.session import ROUTER, Node

WATCHDOG = 0.1
"""Longest time without a set-point while the motors move [s]."""
PERIOD = 0.005
NAMES = ["insertion", "rotation", "bending"]
START = [0.025, 0.0, 0.9]
JOINTS = "sensor_msgs/msg/JointState"


class Motors:
    """Motors that are where the last set-point was [m, rad, rad]."""

    def __init__(self) -> None:
        self.position: Sequence[float] = START
        self.is_stopped = True

    def move(self, setpoint: Sequence[float]) -> None:
        """Move to a set-point (3,) [m, rad, rad]."""
        self.position, self.is_stopped = setpoint, False

    def stop(self) -> None:
        """Quick stop."""
        self.is_stopped = True


def main(endpoint: str = ROUTER) -> None:
    motors, moved_at = Motors(), time.monotonic()
    with Node("driver", connect=endpoint) as node:
        setpoints = node.subscription("/instrument/actuators/setpoint_js", JOINTS)
        positions = node.publisher("/instrument/actuators/measured_js", JOINTS)
        while True:
            message = setpoints.take()
            now = time.monotonic()
            if message is not None:
                motors.move(joint_positions(setpoints.topic, message, NAMES))
                moved_at = now
            elif not motors.is_stopped and now - moved_at > WATCHDOG:
                motors.stop()
                print(json.dumps({"event": "quick stop", "silence": now - moved_at}), flush=True)
            positions.publish(messages.joint_state(time.time_ns(), NAMES, motors.position))
            time.sleep(PERIOD)


if __name__ == "__main__":
    main(*sys.argv[1:])
