"""Replacement of the generated sections of documentation pages."""

import re
from pathlib import Path

from tautscope.runs.output_folder import replace_text


def find(page: Path, name: str) -> re.Match[str]:
    """Find the text between the markers ``<!-- name: begin -->`` and ``<!-- name: end -->``.

    Raises:
        ValueError: The page does not contain each marker once, in this order.
    """
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    pattern = f"(?<={re.escape(begin)}).*?(?={re.escape(end)})"
    found = list(re.finditer(pattern, page.read_text(encoding="utf-8"), re.DOTALL))
    if len(found) != 1:
        raise ValueError(f"{page} must contain {begin} and {end} once each")
    return found[0]


def insert(page: Path, name: str, text: str) -> None:
    """Replace the text between the markers; after an error the page is as before.

    Raises:
        ValueError: The page does not contain each marker once, in this order.
        OSError: It cannot be written.
    """
    old = find(page, name)
    replace_text(page, f"{old.string[: old.start()]}\n{text}\n{old.string[old.end() :]}")
