"""For what moves motors: priority over other programs, memory that stays, few pauses."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress

SETPOINTS, LOOP, VISION, OTHERS = 60, 40, 20, 10
"""SCHED_FIFO priorities of the thread that sends set-points, of the loop, of the thread that looks
at images, and of what else runs in their process: a thread that holds Python's lock and is kept
waiting by another program would keep them waiting too."""
REMEDY = (
    f'printf \'%s\\n\' "$USER - rtprio {SETPOINTS}" "$USER - memlock unlimited" | '
    "sudo tee /etc/security/limits.d/90-tautscope.conf, then log in again"
)
"""What gives the priority and keeps the memory where that is refused."""
_LOCK_AS_TOUCHED = 1 | 2 | 4
"""mlockall's MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT on x86 and ARM: what was touched stays."""
_NEVER = 1_000_000
"""Searches of the younger objects before one of all; there are a few in a second."""
_SWITCH_INTERVAL = 5e-4
"""For how long a thread may keep Python's lock when another wants it [s]; 5 ms is the default."""


@contextmanager
def realtime(priority: int) -> Iterator[str]:
    """SCHED_FIFO for the calling thread while the block lasts; threads it starts inherit it.

    Yields:
        Nothing if it was granted, else why not and what to do.
    """
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


def settle(priority: int) -> None:
    """SCHED_FIFO for the calling thread for good, where it is permitted."""
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


def step_back(priority: int) -> None:
    """A lower SCHED_FIFO priority for the calling thread for good, if it inherited one."""
    if hasattr(os, "sched_getscheduler") and os.sched_getscheduler(0) == os.SCHED_FIFO:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


@contextmanager
def quick_switching() -> Iterator[None]:
    """Python's threads wait less for each other while the block lasts."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_INTERVAL)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


@contextmanager
def little_collection() -> Iterator[None]:
    """Python's search for cycles of dead objects stops all threads: only the youngest are searched.

    A search of all takes the longer the more a run has kept.
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
def memory_kept() -> Iterator[str]:
    """What this process has touched stays in memory while the block lasts (mlockall).

    Else code that has not run for a while, that of a stop for one, is read from a disk that a
    recording keeps busy.

    Yields:
        Nothing if it was granted, else why not and what to do.
    """
    if sys.platform != "linux":
        yield f"{sys.platform}: memory is not kept from being paged out"
        return
    system = ctypes.CDLL(None, use_errno=True)
    if system.mlockall(_LOCK_AS_TOUCHED):
        yield f"memory may be paged out ({os.strerror(ctypes.get_errno())}). Run: {REMEDY}"
        return
    try:
        yield ""
    finally:
        system.munlockall()
