"""Real-time settings of a process: SCHED_FIFO priorities, locked memory, garbage collection."""

import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress

SETPOINTS, LOOP, VISION, OTHERS = 60, 40, 20, 10
"""SCHED_FIFO priorities of the set-point thread, the control loop, marker detection, and all other
threads of the process: a thread that is preempted while it holds the GIL blocks the others too."""
REMEDY = (
    f'printf \'%s\\n\' "$USER - rtprio {SETPOINTS}" "$USER - memlock unlimited" | '
    "sudo tee /etc/security/limits.d/90-tautscope.conf, then log in again"
)
"""The command that permits real-time priority and locked memory."""
_MLOCK_ON_FAULT = 1 | 2 | 4
"""Flags of mlockall: MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT on x86 and ARM."""
_NEVER = 1_000_000
"""Threshold of the oldest generation, which is not reached in a run."""
_SWITCH_INTERVAL = 5e-4
"""How long a thread may hold the GIL while another waits [s]; the default is 5 ms."""


@contextmanager
def realtime(priority: int) -> Iterator[str]:
    """Run the block and its threads in SCHED_FIFO; yields "", or why not and the remedy."""
    if not hasattr(os, "sched_setscheduler"):
        yield f"{sys.platform} has no SCHED_FIFO; set-points may be late under load"
        return
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        yield (
            f"no real-time priority ({error.strerror}); set-points may be late under load. "
            f"Run: {REMEDY}"
        )
        return
    try:
        yield ""
    finally:
        os.sched_setscheduler(0, policy, parameters)


def set_realtime_priority(priority: int) -> None:
    """Set SCHED_FIFO for the calling thread permanently, if it is permitted."""
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


def realtime_executor(name: str, priority: int) -> ThreadPoolExecutor:
    """A thread in SCHED_FIFO, if it is permitted, that runs what is submitted to it."""
    return ThreadPoolExecutor(1, name, set_realtime_priority, (priority,))


def lower_realtime_priority(priority: int) -> None:
    """Lower the SCHED_FIFO priority of the calling thread permanently, if it inherited one."""
    if hasattr(os, "sched_getscheduler") and os.sched_getscheduler(0) == os.SCHED_FIFO:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


@contextmanager
def short_switch_interval() -> Iterator[None]:
    """Shorten the switch interval of Python's threads for the block."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


@contextmanager
def limited_garbage_collection() -> Iterator[None]:
    """Suspend garbage collection of the oldest generation for the block.

    A full collection stops all threads for a time that grows with the objects a run has kept.
    """
    gc.collect()
    gc.freeze()
    youngest, younger, oldest = gc.get_threshold()
    gc.set_threshold(youngest, younger, _NEVER)
    try:
        yield
    finally:
        gc.set_threshold(youngest, younger, oldest)
        gc.unfreeze()


@contextmanager
def locked_memory() -> Iterator[str]:
    """Lock the pages that this process has touched in memory for the block (mlockall).

    Otherwise rarely used code, such as a quick stop, may have to be paged in from a busy disk.
    Yields as `realtime`.
    """
    if sys.platform != "linux":
        yield f"{sys.platform}: memory cannot be locked"
        return
    system = ctypes.CDLL(None, use_errno=True)
    if system.mlockall(_MLOCK_ON_FAULT):
        yield f"memory may be paged out ({os.strerror(ctypes.get_errno())}). Run: {REMEDY}"
        return
    try:
        yield ""
    finally:
        system.munlockall()


@contextmanager
def realtime_process(priority: int) -> Iterator[str]:
    """`realtime` with locked memory and limited garbage collection."""
    with limited_garbage_collection(), locked_memory(), realtime(priority) as refusal:
        yield refusal
