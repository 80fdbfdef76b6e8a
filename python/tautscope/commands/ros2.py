"""The command ``tautscope ros2``."""

import argparse

from tautscope.commands import arguments
from tautscope.commands.printing import print_json
from tautscope.commands.rig_choice import add_rig, add_robot, choose_rig, rig_in_words
from tautscope.config import load_config
from tautscope.errors import ConfigError
from tautscope.extras import require_extras
from tautscope.ros2.inputs import JoyAxes


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    ros2 = arguments.add_verb(
        verbs,
        "ros2",
        _ros2,
        help="run the loop as a node of ROS 2, without a ROS installation",
        description="Run the loop as a node of ROS 2: messages of rmw_zenoh over Zenoh. References "
        "come from ROS; docs/interfaces/ros2.md lists the topics. Without --twin or --driver THE "
        "MOTORS of the configuration or the rig MOVE, once a node enables them. Who can connect "
        "can move them: the node listens on this computer only. Research software, not a medical "
        "device.",
        extras=["ros2"],
    )
    arguments.add_config(ros2)
    arguments.add_profile(ros2, "how slack is compensated")
    kind = ros2.add_mutually_exclusive_group()
    kind.add_argument("--twin", action="store_true", help="move the simulated instrument")
    kind.add_argument(
        "--driver",
        action="store_true",
        help="send set-points to a driver in ROS, and take images or measurements from ROS",
    )
    add_rig(kind, "move a rig of yours in real time")
    add_robot(ros2, "with --twin, another simulated robot in place of the article's instrument")
    ros2.add_argument(
        "--device",
        choices=["servo_jp", "joy"],
        default="servo_jp",
        help="topic of the reference: positions, or a joystick [servo_jp]",
    )
    ros2.add_argument(
        "--axes",
        nargs="+",
        type=arguments.natural,
        default=(1, 0, 4),
        metavar="N",
        help="of joy: the axis of each degree of freedom [1 0 4]",
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
    ros2.add_argument(
        "--distribution",
        choices=["humble", "jazzy"],
        default="jazzy",
        help="of the other nodes; jazzy also for later ones [%(default)s]",
    )
    arguments.add_out(ros2, "ros2")
    arguments.add_json(ros2)


def _ros2(options: argparse.Namespace) -> int:
    if not (options.driver or options.rig):
        require_extras("tautscope ros2", ["twin" if options.twin else "hardware"])
    from tautscope.hardware.realtime import OTHERS, realtime  # noqa: PLC0415
    from tautscope.ros2.session import Node  # noqa: PLC0415
    from tautscope.ros2.start import NAME, start_node  # noqa: PLC0415

    if options.device != "joy":
        arguments.refuse_unused(options, "--device joy", "axes", "button")
    if options.listen is not None:
        arguments.refuse_unused(options, "no --listen, which needs no router", "connect")
    if options.driver and options.robot is None:
        config, make_rig = load_config(options.config, options.profile), None
    else:
        config, make_rig = choose_rig(options, in_real_time=True)
    if options.device == "joy" and len(options.axes) != len(config.dofs):
        allowed = f"{len(config.dofs)} axes, one per degree of freedom"
        raise ConfigError("--axes", list(options.axes), allowed)
    folder = arguments.out_folder(options)
    endpoints = {"connect": options.connect}
    if options.listen is not None:
        endpoints = {"connect": "", "listen": options.listen}
    with realtime(OTHERS):  # Zenoh's threads inherit the priority
        opened = Node(
            NAME,
            options.namespace,
            domain=options.domain,
            distribution=options.distribution,
            **endpoints,
        )
    what = "a driver in ROS" if options.driver else rig_in_words(options)

    def say(key: str, value: str, text: str) -> None:
        print_json(options, {key: value})
        print(text, flush=True)

    def announce(name: str) -> None:
        say("node", name, f"The node {name} commands {what}, once it is enabled. Ctrl-C ends.")

    with opened as node:
        folder.mkdir(parents=True, exist_ok=True)
        return start_node(
            config,
            node,
            folder,
            announce,
            make_rig=make_rig,
            device=options.device,
            layout=JoyAxes(tuple(options.axes), options.button),
            on_result=lambda text: say("result", text, text),
        )
