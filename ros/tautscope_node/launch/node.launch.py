"""The node of a package, configured and activated; `state_command` enables it.

ros2 launch tautscope_node node.launch.py config:=/path/to/config.toml
ros2 launch tautscope_control node.launch.py config:=/path/to/config.toml
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

PACKAGE = Path(__file__).parents[1].name
"""The package with which this file is installed, as share/PACKAGE/launch/node.launch.py."""


def generate_launch_description() -> LaunchDescription:
    """One lifecycle node in the namespace of the instrument."""
    node = LifecycleNode(
        package=PACKAGE,
        executable="instrument_node",
        name="tautscope",
        namespace=LaunchConfiguration("namespace"),
        parameters=[
            {
                "config": LaunchConfiguration("config"),
                "image_topic": LaunchConfiguration("image_topic"),
            }
        ],
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
