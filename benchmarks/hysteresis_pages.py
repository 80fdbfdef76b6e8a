"""The documentation's tables and figures of the hysteresis benchmark, between their markers."""

from __future__ import annotations

from collections.abc import Sequence

from doc_pages import ROOT, insert
from hysteresis_figures import FIGURES
from hysteresis_table import Row, full, short

PAGE = ROOT / "docs" / "hysteresis.md"
README = ROOT / "README.md"
FOLDER = ROOT / "docs" / "figures" / "hysteresis"


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
