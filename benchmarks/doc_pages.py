"""Pages of the documentation with parts that benchmarks make."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def insert(page: Path, name: str, text: str) -> None:
    """Put text between a page's markers ``<!-- name: begin -->`` and ``<!-- name: end -->``.

    Raises:
        ValueError: The page does not have each of them once, in this order.
    """
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    pattern = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", re.DOTALL)
    old = page.read_text(encoding="utf-8")
    if len(pattern.findall(old)) != 1:
        raise ValueError(f"{page} needs {begin} and {end}, once each")
    page.write_text(pattern.sub(lambda _: f"{begin}\n{text}\n{end}", old), encoding="utf-8")
