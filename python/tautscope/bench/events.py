"""Events of the bench, printed as JSON lines."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from dataclasses import dataclass

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


class EventPrinter:
    """A thread that prints each event as a JSON line.

    Args:
        events: Returns all events so far.
    """

    def __init__(self, events: Callable[[], list[Event]]) -> None:
        self._events = events
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Print the remaining events and end."""
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        lower_realtime_priority(OTHERS)
        count = 0
        is_last = False
        while not is_last:
            is_last = self._stopping.wait(0.02)
            for event in self._events()[count:]:
                count += 1
                line = {"time": event.time, "dof": event.dof, "what": event.what}
                print(json.dumps(line), flush=True)
