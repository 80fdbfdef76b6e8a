"""Requests to the bench, one per line of its standard input."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path


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
