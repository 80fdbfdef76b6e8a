"""Opening of a rig, which takes seconds, and may be interrupted meanwhile."""

from __future__ import annotations

import threading
from collections.abc import Callable

from tautscope.hardware.rig import HardwareRig
from tautscope.loop.rig import Rig, Sample

_PERIOD = 0.005
"""Time between two calls of `must_stop` [s]."""


def reset_rig(rig: Rig, must_stop: Callable[[], bool]) -> Sample:
    """Reset a rig; drives of a configuration are quick-stopped as soon as `must_stop` is true.

    Args:
        rig: The rig.
        must_stop: Called periodically, in another thread.

    Raises:
        TautscopeError: The rig cannot be opened, or was interrupted.
    """
    if not isinstance(rig, HardwareRig):
        return rig.reset()
    is_over = threading.Event()

    def watch() -> None:
        while not is_over.wait(_PERIOD):
            if must_stop():
                rig.interrupt()

    thread = threading.Thread(target=watch, name="opening")
    thread.start()
    try:
        return rig.reset()
    finally:
        is_over.set()
        thread.join()
