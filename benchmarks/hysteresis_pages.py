"""The documentation's tables and figures of the hysteresis benchmark, between their markers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from hysteresis_figures import FIGURES
from hysteresis_table import Row, full, short

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "hysteresis.md"
README = ROOT / "README.md"
FOLDER = ROOT / "docs" / "figures" / "hysteresis"


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


def write_tables(rows: Sequence[Row], drawn: Sequence[str], made: str) -> None:
    """The README's table, the page's, and the page's figures."""
    insert(README, "hysteresis", f"{short(rows)}\n\n{made}".replace(" (worst)", ""))
    insert(PAGE, "hysteresis", f"{made}\n\n{full(rows)}")
    folder = FOLDER.relative_to(PAGE.parent).as_posix()
    pictures = [f"![{FIGURES[name][1]}]({folder}/{name}.png)" for name in drawn]
    captions = [f"*{FIGURES[name][1]}.*" for name in drawn]
    parts = [text for pair in zip(pictures, captions, strict=True) for text in pair]
    insert(PAGE, "figures", "\n\n".join(parts))


def write_ablation(table: str, made: str) -> None:
    """The page's table of what each idea earns."""
    insert(PAGE, "ablation", f"{made.removesuffix(' (worst).')}.\n\n{table}")
