"""Replacement of the generated sections of documentation pages."""

import re
from pathlib import Path


def insert(page: Path, name: str, text: str) -> None:
    """Replace the text between the markers ``<!-- name: begin -->`` and ``<!-- name: end -->``.

    Raises:
        ValueError: The page does not contain each marker once, in this order.
    """
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    pattern = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", re.DOTALL)
    old = page.read_text(encoding="utf-8")
    if len(pattern.findall(old)) != 1:
        raise ValueError(f"{page} must contain {begin} and {end} once each")
    page.write_text(pattern.sub(lambda _: f"{begin}\n{text}\n{end}", old), encoding="utf-8")
