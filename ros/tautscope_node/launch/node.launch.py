"""The node of a package, configured and activated; `state_command` enables it.

ros2 launch tautscope_node node.launch.py config:=/path/to/config.toml
ros2 launch tautscope_control node.launch.py config:=/path/to/config.toml params_file:=node.yaml
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, RegisterEventHandler
from launch.events import matches_action
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from lifecycle_msgs.msg import Transition

SHARE = Path(__file__).parents[1]
"""share/PACKAGE of the package with which this file is installed."""


def generate_launch_description() -> LaunchDescription:
    """One lifecycle node in the namespace of the instrument."""
    node = LifecycleNode(
        package=SHARE.name,
        executable="instrument_node",
        name="tautscope",
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            LaunchConfiguration("params_file"),
            {"config": LaunchConfiguration("config")},
        ],
        # As a parameter it would replace that of the file.
        remappings=[("/endoscope/image_raw", LaunchConfiguration("image_topic"))],
        output="screen",
    )

    def change(transition: int) -> EmitEvent:
        matcher = matches_action(node)
        return EmitEvent(
            event=ChangeState(lifecycle_node_matcher=matcher, transition_id=transition)
        )

    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "config",
                description="Configuration; missing keys have their defaults",
            ),
            DeclareLaunchArgument(
                "params_file",
                default_value=str(SHARE / "config" / "node.yaml"),
                description="YAML file with the other parameters, headed /**",
            ),
            DeclareLaunchArgument("namespace", default_value="instrument"),
            DeclareLaunchArgument("image_topic", default_value="/endoscope/image_raw"),
            RegisterEventHandler(
                OnStateTransition(
                    target_lifecycle_node=node,
                    start_state="configuring",
                    goal_state="inactive",
                    entities=[change(Transition.TRANSITION_ACTIVATE)],
                )
            ),
            node,
            change(Transition.TRANSITION_CONFIGURE),
        ]
    )
