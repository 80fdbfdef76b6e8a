"""Questions to the person at the terminal."""

import argparse
import sys
from pathlib import Path

from tautscope.config import CameraConfig
from tautscope.errors import FieldError

TERMINAL = Path("/dev/tty")


def ask(question: str, camera: CameraConfig) -> str:
    """Ask on stderr, and return the line typed in lower case; empty if there is nobody to answer.

    Args:
        question: Text.
        camera: If its images come through the standard input, the terminal is read instead.
    """
    print(question, end="", file=sys.stderr, flush=True)
    if not camera.source.url.startswith("pipe:"):
        return sys.stdin.readline().lower() if sys.stdin else ""  # None if it was closed
    try:
        with TERMINAL.open(encoding="utf-8") as terminal:
            return terminal.readline().lower()
    except OSError:
        return ""


def confirm(question: str, options: argparse.Namespace, camera: CameraConfig) -> None:
    """Ask whether the motors may move, unless ``--yes``.

    Raises:
        FieldError: The answer is not y.
    """
    if options.yes:
        return
    if ask(f"{question} Type y to start: ", camera).strip() not in ("y", "yes"):
        raise FieldError("answer", "no", "y, or the option --yes; nothing moved")
