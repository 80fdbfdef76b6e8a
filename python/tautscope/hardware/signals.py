"""POSIX signals: a process that is asked to end stops its motors first."""

import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType

Handler = Callable[[int, FrameType | None], object]
TERMINATING = tuple(
    getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)
)
DEFERRED = (signal.SIGINT, *TERMINATING)


@contextmanager
def exit_on_signals() -> Iterator[None]:
    """Make SIGTERM and SIGHUP raise SystemExit in the main thread, so that every ``with`` is left.

    By default they end the process at once, and only the drives' watchdogs stop the motors. SIGINT
    raises KeyboardInterrupt, also in a background process whose shell ignores it. The handlers are
    restored at the end. Outside the main thread this does nothing.
    """
    with exit_on_termination(), _installed({signal.SIGINT: signal.default_int_handler}):
        yield


@contextmanager
def exit_on_termination() -> Iterator[None]:
    """As `exit_on_signals`, for a process without motors: SIGINT is left as it is.

    SIGHUP stays ignored where it is: nohup asks for that.
    """

    def exit_process(number: int, frame: FrameType | None) -> None:
        raise SystemExit(128 + number)

    numbers = [each for each in TERMINATING if signal.getsignal(each) is not signal.SIG_IGN]
    with _installed(dict.fromkeys(numbers, exit_process)):
        yield


@contextmanager
def defer_signals() -> Iterator[None]:
    """Defer signals that end the process until the end of the block.

    A second Ctrl-C cannot interrupt a quick stop. Outside the main thread this does nothing.
    """
    received: list[int] = []
    try:
        with _installed(dict.fromkeys(DEFERRED, lambda number, frame: received.append(number))):
            yield
    finally:
        for number in dict.fromkeys(received):
            signal.raise_signal(number)


@contextmanager
def _installed(handlers: Mapping[int, Handler]) -> Iterator[None]:
    """Install signal handlers for the block, if this is the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
