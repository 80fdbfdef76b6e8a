"""Printing of JSON and tables."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console


def print_json(document: dict[str, Any]) -> None:
    """Print a document in one line; it must not contain NaN."""
    print(json.dumps(document, allow_nan=False))


def console() -> Console:
    """A console for tables; outside a terminal it is 200 columns wide."""
    from rich.console import Console  # noqa: PLC0415

    width = None if sys.stdout.isatty() else 200
    return Console(highlight=False, markup=False, width=width)
