"""Start of the node ``tautscope ros2``."""

from __future__ import annotations

import logging
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path

from tautscope.config import Config
from tautscope.errors import ConfigError
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
from tautscope.loop.rig import Rig
from tautscope.ros2.clock import Clock
from tautscope.ros2.control import NodeControl
from tautscope.ros2.driver import DriverRig
from tautscope.ros2.inputs import JoyAxes
from tautscope.ros2.references import JOY, JoyReference, ServoReference, Source
from tautscope.ros2.sensors import Sensors
from tautscope.ros2.session import Node
from tautscope.ros2.telemetry import Telemetry, Topics

MakeRig = Callable[[Config], Rig]
"""Makes the rig that the loop commands."""
_LOG = logging.getLogger(__name__)
NAME = "tautscope"
"""Name of the node."""


def start_node(
    config: Config,
    node: Node,
    folder: Path,
    announce: Callable[[str], None],
    *,
    make_rig: MakeRig | None,
    device: str,
    layout: JoyAxes,
    on_result: Callable[[str], None],
) -> int:
    """Run the node until it is finalized, or a signal; the exit status.

    The motors are quick-stopped and the log is closed on every exit.

    Args:
        config: Settings.
        node: The node; the caller closes it.
        folder: New; for logs.
        announce: Called with the name of the node when it is ready.
        make_rig: Makes the rig; None for a driver in ROS.
        device: `tautscope.ros2.references.SERVO` or `JOY`.
        layout: Axes and button of a gamepad.
        on_result: As of `tautscope.ros2.control.NodeControl`.

    Raises:
        ConfigError: The configuration does not describe a rig; as `build_control`.
    """
    has_drives = make_rig is HardwareRig
    if not has_drives:
        config = config.replace(drives=None)
    with (
        exit_on_signals(),
        realtime_executor("vision", VISION) as executor,
    ):
        control = build_control(
            config,
            node,
            folder,
            executor,
            Clock(),
            make_rig=make_rig,
            device=device,
            layout=layout,
            on_result=on_result,
        )
        with (
            short_switch_interval(),
            realtime_process(OTHERS if has_drives else LOOP) as refusal,
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
    make_rig: MakeRig | None,
    device: str,
    layout: JoyAxes,
    on_result: Callable[[str], None] = lambda _: None,
) -> NodeControl:
    """The control of a node, unconfigured.

    Raises:
        ConfigError: Without a rig of its own nothing would measure the tip, or the axes are not
            one per degree of freedom.
    """
    topics = Topics(node.identity.namespace)
    telemetry = Telemetry(config, node, topics, clock, has_rig=make_rig is not None)
    refuse = telemetry.refuse
    joints = [dof.label for dof in config.dofs]
    if config.dof and make_rig is None and not config.measurement.topics:
        raise ConfigError("measurement.topics", None, "a topic that measures the tip")
    source: Source = (
        JoyReference(config, node, topics.joy, clock=clock, refuse=refuse, layout=layout)
        if device == JOY
        else ServoReference(node, topics.servo, joints, clock, refuse)
    )
    if make_rig is None:
        driver = DriverRig(
            config,
            node,
            instrument=topics.instrument,
            image=topics.image,
            clock=clock,
            refuse=refuse,
        )
        make_rig = lambda _: driver  # noqa: E731
    return NodeControl(
        config,
        node,
        topics,
        telemetry,
        source=source,
        sensors=Sensors(config, node, clock, refuse),
        make_rig=make_rig,
        folder=folder,
        executor=executor,
        clock=clock,
        on_result=on_result,
    )
