"""Events of the bench, printed as JSON lines."""

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass

from tautscope.hardware.realtime import OTHERS, lower_realtime_priority


@dataclass(frozen=True, slots=True)
class Event:
    """An event of a drive or the camera.

    Attributes:
        time: [s], monotonic clock, which all processes of the computer share.
        dof: The drive's DOF, or ``camera``.
        what: The state entered, or ``fault: <kind>``.
    """

    time: float
    dof: str
    what: str


@contextmanager
def repeating(work: Callable[[], None], period: float) -> Iterator[None]:
    """Work in a thread every `period` [s], and once more at the end of the block."""
    stopping = threading.Event()

    def run() -> None:
        lower_realtime_priority(OTHERS)
        is_last = False
        while not is_last:
            is_last = stopping.wait(period)
            work()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        yield
    finally:
        stopping.set()
        thread.join()


def print_events(events: Callable[[], list[Event]]) -> AbstractContextManager[None]:
    """Print each event as a JSON line, in a thread; `events` returns all so far."""
    printed = 0

    def work() -> None:
        nonlocal printed
        for event in events()[printed:]:
            printed += 1
            print(json.dumps(asdict(event)), flush=True)

    return repeating(work, 0.02)
