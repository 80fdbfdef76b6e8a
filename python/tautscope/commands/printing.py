"""What several verbs print with."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console


def print_json(document: dict[str, Any]) -> None:
    """Print one line; NaN has no place in it."""
    print(json.dumps(document, allow_nan=False))


def console() -> Console:
    """Prints tables; without a terminal wide enough for all of them."""
    from rich.console import Console  # noqa: PLC0415

    width = None if sys.stdout.isatty() else 200
    return Console(highlight=False, markup=False, width=width)
