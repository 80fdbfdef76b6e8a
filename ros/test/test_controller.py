"""The controller of ros2_control: as a plugin, and with a controller manager on mock hardware."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from ament_index_python.packages import (
    PackageNotFoundError,
    get_package_prefix,
    get_package_share_directory,
)
from conftest import Laboratory, last_motion
from sensor_msgs.msg import JointState


def test_the_plugin_gives_the_commands_of_the_loop(tmp_path):
    import record

    record.record_features("best").write(tmp_path, "best")
    record.record_tip("best").write(tmp_path, "tip_best")
    program = (
        Path(get_package_prefix("tautscope_control")) / "lib/tautscope_control/controller_test"
    )
    subprocess.run([program, tmp_path / "best", tmp_path / "tip_best"], check=True, timeout=300)


def test_a_session_on_mock_hardware(ros, processes, recorded):
    try:
        get_package_prefix("robot_state_publisher")
    except PackageNotFoundError:
        pytest.skip("robot_state_publisher is not installed")
    launch = Path(get_package_share_directory("tautscope_control")) / "launch/controller.launch.py"
    processes.append(subprocess.Popen(["ros2", "launch", launch, f"config:={recorded.config}"]))
    laboratory = Laboratory("/instrument", "/joint_states")
    laboratory.wait_for(lambda: laboratory.states[-1:] == ["ENABLED"], 60.0)
    last, shown = laboratory.replay(recorded)
    laboratory.spin(1.0)
    # Mock hardware is where it was commanded.
    motion = last_motion([in_order(each) for each in laboratory.commands])
    assert last - 500_000_000 < motion <= last + 100_000_000
    assert laboratory.states[-1] == "PAUSED"
    measured = [each for each in laboratory.measured if each.header.stamp.sec]
    assert len(measured) > 0.5 * len(shown)
    # The tip was seen near where the motors are.
    distance = np.abs(np.array(measured[-1].position) - recorded.ticks[-1][2:5])
    assert (distance < [15e-3, 2.0, 1.0]).all()
    laboratory.destroy_node()


def in_order(message):
    order = np.argsort(message.name)
    positions = np.array(message.position)[order].tolist()
    return JointState(header=message.header, name=sorted(message.name), position=positions)
