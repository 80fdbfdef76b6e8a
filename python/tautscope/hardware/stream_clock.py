"""When a frame was captured, from the time stamps of its source."""

from __future__ import annotations

from collections import deque

from tautscope.config import SourceConfig

JUMP = 1.0
"""Time stamps that go on by more, or back, are another clock [s]."""


class StreamClock:
    """Time stamps of a source put on our clock.

    A frame can come late, never early: of all in the last `clock_window`, the one that came
    soonest after its time stamp tells how far apart the clocks are,
    ``captured_at = stamp + min(arrival - stamp) - delay``. A constant delay cannot be seen so and
    is to be configured. A source that drifts by 1 s per day errs by 0.1 ms in a window of 10 s.

    Args:
        source: Its `clock`, `clock_window` and `delay`.
    """

    def __init__(self, source: SourceConfig) -> None:
        self._source = source
        self._shortest: deque[tuple[float, float]] = deque()
        """(arrival, arrival - stamp), the second rising: the first is the smallest."""
        self._last: float | None = None

    def captured_at(self, stamp: float | None, arrived_at: float) -> float:
        """When a frame was captured [s, the clock of `arrived_at`], never after it arrived."""
        source = self._source
        if stamp is None or source.clock == "arrival":
            return arrived_at - source.delay
        if source.clock == "device":
            return stamp - source.delay
        if self._last is not None and not 0 <= stamp - self._last <= JUMP:
            self._shortest.clear()
        self._last = stamp
        lag = arrived_at - stamp
        while self._shortest and self._shortest[-1][1] >= lag:
            self._shortest.pop()
        self._shortest.append((arrived_at, lag))
        while self._shortest[0][0] < arrived_at - source.clock_window:
            self._shortest.popleft()
        return stamp + self._shortest[0][1] - source.delay
