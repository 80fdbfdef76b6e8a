"""Start of the node ``tautscope ros2``."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path
from typing import Literal

from tautscope.config import Config
from tautscope.console.control_run import LiveRig
from tautscope.hardware.realtime import (
    LOOP,
    OTHERS,
    VISION,
    realtime_executor,
    realtime_process,
    short_switch_interval,
)
from tautscope.hardware.rig import HardwareRig
from tautscope.hardware.signals import defer_signals, exit_on_signals
from tautscope.ros2.clock import Clock
from tautscope.ros2.control import NodeControl
from tautscope.ros2.driver import DriverRig
from tautscope.ros2.inputs import JoyAxes
from tautscope.ros2.references import JOY, JoyReference, ServoReference, Source
from tautscope.ros2.session import Node
from tautscope.ros2.telemetry import Telemetry, Topics

Drives = Literal["twin", "rig", "ros"]
"""What the loop commands: the twin, the drives of the configuration, or a driver in ROS."""
_LOG = logging.getLogger(__name__)
NAME = "tautscope"
"""Name of the node."""


def start_node(
    config: Config,
    node: Node,
    folder: Path,
    announce: Callable[[str], None],
    *,
    drives: Drives,
    device: str,
    layout: JoyAxes,
) -> int:
    """Run the node until it is finalized, or a signal; the exit status.

    The motors are quick-stopped and the log is closed on every exit.

    Args:
        config: Settings.
        node: The node; the caller closes it.
        folder: New; for logs.
        announce: Called with the name of the node when it is ready.
        drives: What the loop commands.
        device: `tautscope.ros2.references.SERVO` or `JOY`.
        layout: Axes and button of a gamepad.

    Raises:
        ConfigError: The configuration does not describe a rig.
    """
    if drives != "rig":
        config = config.replace(drives=None)
    with (
        exit_on_signals(),
        realtime_executor("vision", VISION) as executor,
    ):
        control = build_control(
            config, node, folder, executor, Clock(), drives=drives, device=device, layout=layout
        )
        with (
            short_switch_interval(),
            realtime_process(OTHERS if drives == "rig" else LOOP) as refusal,
        ):
            if refusal:
                _LOG.warning("%s", refusal)
            try:
                announce(node.identity.path)
                control.main()
            except KeyboardInterrupt:
                return 0
            finally:
                with defer_signals():
                    control.shut_down()
    return 0


def build_control(
    config: Config,
    node: Node,
    folder: Path,
    executor: Executor,
    clock: Clock,
    *,
    drives: Drives,
    device: str,
    layout: JoyAxes,
) -> NodeControl:
    """The control of a node, unconfigured."""
    topics = Topics(node.identity.namespace)
    telemetry = Telemetry(config, node, topics, clock, has_rig=drives != "ros")
    refuse = telemetry.refuse
    source: Source = (
        JoyReference(config, node, topics.joy, clock=clock, refuse=refuse, layout=layout)
        if device == JOY
        else ServoReference(node, topics.servo, clock, refuse)
    )
    make_rig: Callable[[], LiveRig]
    if drives == "ros":
        driver = DriverRig(
            config,
            node,
            instrument=topics.instrument,
            image=topics.image,
            clock=clock,
            refuse=refuse,
        )
        make_rig = lambda: driver  # noqa: E731
    elif drives == "twin":
        from tautscope.console.live_twin import LiveTwin  # noqa: PLC0415  MuJoCo

        make_rig = lambda: LiveTwin(config)  # noqa: E731
    else:
        make_rig = lambda: HardwareRig(config)  # noqa: E731
    return NodeControl(
        config,
        node,
        topics,
        telemetry,
        source=source,
        make_rig=make_rig,
        folder=folder,
        executor=executor,
        clock=clock,
    )
