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
    input, and the terminal of a process in the background: reading it would stop the process.
    """
    if not _is_nothing():
        try:
            yield from sys.stdin
        except OSError:
            pass  # the terminal, after the process went to the background
        else:
            return
    while True:
        signal.pause()


def _is_nothing() -> bool:
    signal.signal(signal.SIGTTIN, signal.SIG_IGN)  # reading fails then
    if sys.stdin is None:
        return True
    try:
        if os.isatty(0):
            return os.tcgetpgrp(0) != os.getpgrp()
        return os.path.samestat(os.fstat(0), Path(os.devnull).stat())
    except OSError:
        return True
