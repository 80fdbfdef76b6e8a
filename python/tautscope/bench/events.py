"""Events of the bench, printed as JSON lines."""

import json
import threading
from collections.abc import Callable
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


class Repeater:
    """A thread that works every `period` [s], and once more when it is closed."""

    def __init__(self, work: Callable[[], None], period: float) -> None:
        self._work, self._period = work, period
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Work once more and end."""
        self._stopping.set()
        self._thread.join()

    def _run(self) -> None:
        lower_realtime_priority(OTHERS)
        is_last = False
        while not is_last:
            is_last = self._stopping.wait(self._period)
            self._work()


class EventPrinter(Repeater):
    """A thread that prints each event as a JSON line.

    Args:
        events: Returns all events so far.
    """

    def __init__(self, events: Callable[[], list[Event]]) -> None:
        self._events, self._count = events, 0
        super().__init__(self._print, 0.02)

    def _print(self) -> None:
        for event in self._events()[self._count :]:
            self._count += 1
            print(json.dumps(asdict(event)), flush=True)
