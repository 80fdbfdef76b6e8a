"""The command ``tautscope ros2``."""

from __future__ import annotations

import argparse
import sys

from tautscope.commands import arguments
from tautscope.commands.article_config import article_config
from tautscope.commands.printing import print_json
from tautscope.config.placeholders import refuse_placeholders
from tautscope.errors import ConfigError
from tautscope.extras import require_extras


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    ros2 = arguments.add_verb(
        verbs,
        "ros2",
        help="run the loop as a node of ROS 2, without a ROS installation",
        description="Run the loop as a node of ROS 2: messages of rmw_zenoh over Zenoh. References "
        "come from ROS; docs/interfaces/ros2.md lists the topics. Without --twin or --driver THE "
        "MOTORS of the configuration MOVE, once a node enables them. Who can connect can move "
        "them: the node listens on this computer only. Research software, not a medical device.",
        extras=["ros2"],
    )
    arguments.add_config(ros2)
    arguments.add_profile(ros2, "how slack is compensated")
    kind = ros2.add_mutually_exclusive_group()
    kind.add_argument("--twin", action="store_true", help="move the simulated instrument")
    kind.add_argument(
        "--driver",
        action="store_true",
        help="send set-points to a driver in ROS, and take images from ROS",
    )
    ros2.add_argument(
        "--device",
        choices=["servo_jp", "joy"],
        default="servo_jp",
        help="topic of the reference: positions, or a joystick [servo_jp]",
    )
    ros2.add_argument(
        "--axes",
        nargs=3,
        type=arguments.natural,
        default=(1, 0, 4),
        metavar="N",
        help="of joy: axes of insertion, rotation, bending [1 0 4]",
    )
    ros2.add_argument(
        "--button",
        type=arguments.natural,
        default=4,
        metavar="N",
        help="of joy: the dead man's button [4]",
    )
    ros2.add_argument(
        "--connect",
        default="tcp/127.0.0.1:7447",
        metavar="ENDPOINT",
        help="router of rmw_zenoh, or another node [%(default)s]",
    )
    ros2.add_argument(
        "--listen",
        metavar="ENDPOINT",
        help="own endpoint on this computer, without a router: tcp/127.0.0.1:7447",
    )
    ros2.add_argument("--namespace", default="", metavar="/NAME", help="before every topic [none]")
    ros2.add_argument(
        "--domain", type=arguments.natural, default=0, metavar="N", help="ROS_DOMAIN_ID [0]"
    )
    arguments.add_out(ros2, "ros2")
    arguments.add_json(ros2)
    ros2.set_defaults(run=_ros2)


def _ros2(options: argparse.Namespace) -> int:
    if not options.driver:
        require_extras("tautscope ros2", ["twin" if options.twin else "hardware"])
    from tautscope.hardware.realtime import OTHERS, realtime  # noqa: PLC0415
    from tautscope.ros2.inputs import JoyAxes  # noqa: PLC0415
    from tautscope.ros2.session import Node  # noqa: PLC0415
    from tautscope.ros2.start import NAME, start_node  # noqa: PLC0415
    from tautscope.runs.output_folder import check_free, default_folder  # noqa: PLC0415

    config = article_config(options.config, options.profile)
    if not (options.twin or options.driver):
        refuse_placeholders(options.config)
        if config.drives is None:
            allowed = "a section [drives], or the option --twin or --driver"
            raise ConfigError("drives", None, allowed)
    folder = check_free(options.out or default_folder("ros2"))
    endpoints = {"connect": options.connect}
    if options.listen is not None:
        endpoints = {"connect": "", "listen": options.listen}
    with realtime(OTHERS):  # Zenoh's threads inherit the priority
        opened = Node(NAME, options.namespace, domain=options.domain, **endpoints)
    with opened as node:
        folder.mkdir(parents=True, exist_ok=True)
        return start_node(
            config,
            node,
            folder,
            lambda name: _announce(options, name),
            drives="twin" if options.twin else "ros" if options.driver else "rig",
            device=options.device,
            layout=JoyAxes(tuple(options.axes), options.button),
        )


def _announce(options: argparse.Namespace, name: str) -> None:
    if options.json:
        print_json({"node": name})
    else:
        what = f"REAL MOTORS of {options.config}"
        what = "the twin" if options.twin else "a driver in ROS" if options.driver else what
        print(f"The node {name} commands {what}, once it is enabled. Ctrl-C ends.")
    sys.stdout.flush()
