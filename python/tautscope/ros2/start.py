"""Start of the node ``tautscope ros2``."""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tautscope.config import Config
from tautscope.errors import STOPPED
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
from tautscope.ros2.control import MakeRig, NodeControl
from tautscope.ros2.session import Clock, Node

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
    **options: Any,
) -> int:
    """Run the node until it is finalized, or a signal; exit status 4 after an unconfirmed stop.

    The motors are quick-stopped and the log is closed on every exit. The caller closes the node;
    `announce` is called with its name when it is ready. The options are those of `NodeControl`.

    Raises:
        ConfigError: The configuration does not describe a rig; as `NodeControl`.
    """
    has_drives = make_rig is HardwareRig
    if not has_drives:
        config = config.replace(drives=None)
    with exit_on_signals(), realtime_executor("vision", VISION) as executor:
        control = NodeControl(config, node, folder, executor, Clock(), make_rig=make_rig, **options)
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
                pass
            finally:
                with defer_signals():
                    control.shut_down()
    return STOPPED if control.is_unconfirmed else 0
