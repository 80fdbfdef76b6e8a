"""An input device of ROS 2 without a ROS installation: enables the node, and moves it for 10 s.

tautscope ros2 --twin --listen tcp/127.0.0.1:7447
python examples/ros2/input_device.py
"""

import math
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from tautscope.ros2 import messages
from tautscope.ros2.endpoints import Subscription
from tautscope.ros2.session import ROUTER, Node

JOINTS, STATE = "sensor_msgs/msg/JointState", "crtk_msgs/msg/OperatingState"
AMPLITUDES = {"insertion": 0.005, "rotation": 0.5, "bending": 0.3}  # m or rad
OTHER = 0.3  # of any other degree of freedom
PERIOD, RATE = 10.0, 200.0


def main(endpoint: str = ROUTER, duration: str = "10") -> None:
    with Node("operator", connect=endpoint) as node:
        states = node.subscription("/instrument/operating_state", STATE)
        setpoints = node.subscription("/instrument/setpoint_js", JOINTS)
        tips = node.subscription("/instrument/measured_js", JOINTS)
        requests = node.publisher("/instrument/state_command", "crtk_msgs/msg/StringStamped")
        references = node.publisher("/instrument/servo_jp", JOINTS)

        def wait(topic: Subscription, condition: Callable[[Any], bool] = lambda _: True) -> Any:
            while True:
                message = topic.take()
                if message is not None and condition(message):
                    return message
                time.sleep(0.001)

        wait(states)  # the node is there
        requests.publish({"string": "enable"})
        wait(states, lambda state: state.state == "ENABLED")
        first = wait(setpoints)  # a stream that begins here is followed as it is
        amplitude = np.array([AMPLITUDES.get(name, OTHER) for name in first.name])
        begin = time.monotonic()
        while (elapsed := time.monotonic() - begin) < float(duration):
            moved = first.position + amplitude * math.sin(math.tau * elapsed / PERIOD)
            references.publish(messages.joint_state(time.time_ns(), first.name, moved))
            time.sleep(1 / RATE)
        tip = wait(tips)
    at = zip(tip.name, tip.position, strict=True)
    print("tip at", ", ".join(f"{name} {value:.4f}" for name, value in at), "[m or rad]")


if __name__ == "__main__":
    main(*sys.argv[1:])
