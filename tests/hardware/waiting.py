"""Wait for conditions in tests."""

import time
from collections.abc import Callable

TIMEOUT = 60.0  # s; long, for a busy computer


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)
