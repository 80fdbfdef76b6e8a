"""What happens on the bench, and how it is told."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from dataclasses import dataclass

from tautscope.hardware.realtime import OTHERS, step_back


@dataclass(frozen=True, slots=True)
class Event:
    """Something a drive did.

    Attributes:
        time: [s], the computer's monotonic clock, the same in all its processes.
        dof: Which drive, or ``camera``.
        what: The state it went to, or ``fault: <kind>``.
    """

    time: float
    dof: str
    what: str


class Reporter:
    """Writes events as they come, a JSON line each; a thread, as the main one waits for input.

    Args:
        events: All that happened so far; each is written once.
    """

    def __init__(self, events: Callable[[], list[Event]]) -> None:
        self._events = events
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Write the last of them."""
        self._ending.set()
        self._thread.join()

    def _run(self) -> None:
        step_back(OTHERS)
        told = 0
        last = False
        while not last:
            last = self._ending.wait(0.02)
            for event in self._events()[told:]:
                told += 1
                line = {"time": event.time, "dof": event.dof, "what": event.what}
                print(json.dumps(line), flush=True)
