"""Capture times from the time stamps of a video source."""

from collections import deque

from tautscope.config import SourceConfig

JUMP = 1.0
"""Time stamps that advance by more than this, or go back, belong to a new clock [s]."""


class StreamClock:
    """Converts time stamps of a source to the clock of the computer.

    A frame can arrive late, never early. The smallest difference of arrival and stamp in the last
    `clock_window` is therefore the best estimate of the offset between the clocks:

        captured_at = stamp + min(arrival - stamp) - delay

    A constant delay must be configured. A drift of 1 s per day makes an error of 0.1 ms in a window
    of 10 s.
    """

    def __init__(self, source: SourceConfig) -> None:
        self._source = source
        self._shortest: deque[tuple[float, float]] = deque()
        """(arrival, arrival - stamp), in increasing order of the difference."""
        self._last: float | None = None

    def captured_at(self, stamp: float | None, arrived_at: float) -> float:
        """Capture time of a frame [s, the clock of `arrived_at`], never after its arrival."""
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
