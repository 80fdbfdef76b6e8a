"""The clocks of a node: monotonic for control, wall clock for the stamps of messages."""

import time


class Clock:
    """Times in ns; a test may replace it."""

    def monotonic(self) -> int:
        """The monotonic clock [ns]; it is never set."""
        return time.monotonic_ns()

    def wall(self) -> int:
        """The wall clock [ns since 1970], which stamps are of."""
        return time.time_ns()

    def sleep_until(self, instant: int) -> None:
        """Wait until a time of the monotonic clock [ns]."""
        time.sleep(max(0.0, (instant - time.monotonic_ns()) / 1e9))
