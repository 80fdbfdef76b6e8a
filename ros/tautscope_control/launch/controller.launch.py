"""The ros2_control controller on mock hardware.

ros2 launch tautscope_control controller.launch.py config:=/path/to/config.toml
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue


def generate_launch_description() -> LaunchDescription:
    """Controller manager, the URDF that it waits for, and the controllers."""
    share = Path(get_package_share_directory("tautscope_control"))
    controllers = str(share / "config" / "controllers.yaml")
    description = (share / "urdf" / "instrument.urdf").read_text(encoding="utf-8")
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "config",
                description="Configuration; missing keys have their defaults",
            ),
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                parameters=[{"robot_description": ParameterValue(description, value_type=str)}],
            ),
            Node(
                package="controller_manager",
                executable="ros2_control_node",
                parameters=[controllers],
                output="screen",
            ),
            Node(
                package="controller_manager",
                executable="spawner",
                arguments=[
                    "joint_state_broadcaster",
                    "instrument",
                    "--param-file",
                    controllers,
                    "--controller-ros-args",
                    ["-p config:=", LaunchConfiguration("config")],
                ],
            ),
        ]
    )
