"""What the process of a bench waits for: requests on its standard input, and errors of threads."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tautscope.errors import ConfigError


@contextmanager
def raise_errors_of_threads() -> Iterator[None]:
    """Raise the first error that ends a thread, in the main thread, which it interrupts."""
    errors: list[BaseException] = []
    main = threading.get_ident()

    def interrupt(thread: threading.ExceptHookArgs) -> None:
        errors.append(thread.exc_value or thread.exc_type())
        signal.pthread_kill(main, signal.SIGINT)

    hook, threading.excepthook = threading.excepthook, interrupt
    try:
        yield
    finally:
        threading.excepthook = hook
        if errors:
            raise errors[0]


def serve_requests(inject: Callable[[str], None]) -> None:
    """Inject the faults of the standard input until it ends, or Ctrl-C; print what is refused."""
    with suppress(KeyboardInterrupt):
        for line in read_requests():
            try:
                inject(line.strip())
            except ConfigError as error:
                print(f"error: {error}", file=sys.stderr, flush=True)


def read_requests() -> Iterator[str]:
    """Lines of the standard input; from an input that is nothing, none until a signal comes.

    Nothing are the null device, which shells give to a background process (``bench &``), a closed
    input, and the terminal of a process in the background.
    """
    # Reading a terminal in the background fails then, instead of stopping the process.
    signal.signal(signal.SIGTTIN, signal.SIG_IGN)
    try:
        is_nothing = sys.stdin is None or os.path.samestat(os.fstat(0), Path(os.devnull).stat())
        if not is_nothing:
            yield from sys.stdin
            return
    except OSError:
        pass
    while True:
        signal.pause()
