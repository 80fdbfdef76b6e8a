"""Questions to the person at the terminal."""

from __future__ import annotations

import sys
from pathlib import Path

from tautscope.config import CameraConfig

TERMINAL = Path("/dev/tty")


def ask(question: str, camera: CameraConfig) -> str:
    """Ask on stderr, and return the line typed in lower case; empty if there is nobody to answer.

    Args:
        question: Text.
        camera: If its images come through the standard input, the terminal is read instead.
    """
    print(question, end="", file=sys.stderr, flush=True)
    if not camera.source.url.startswith("pipe:"):
        return sys.stdin.readline().lower()
    try:
        with TERMINAL.open(encoding="utf-8") as terminal:
            return terminal.readline().lower()
    except OSError:
        return ""
