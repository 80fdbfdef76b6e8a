"""Tables and figures of the hysteresis benchmark in the documentation."""

from collections.abc import Sequence

from common.doc_pages import insert
from common.paths import ROOT
from hysteresis.figures import FIGURES
from hysteresis.tables import Row, full
from tautscope.dof import Dof

PAGE = ROOT / "docs" / "hysteresis.md"
FOLDER = ROOT / "docs" / "figures" / "hysteresis"
DOFS = " / ".join(dof.label for dof in Dof)


def write_tables(rows: Sequence[Row], drawn: Sequence[str], conditions: str) -> None:
    """Write the table of the page, and its figures."""
    insert(PAGE, "hysteresis", f"{conditions} (worst) of {DOFS}.\n\n{full(rows)}")
    folder = FOLDER.relative_to(PAGE.parent).as_posix()
    images = [f"![{name}]({folder}/{name}.png)" for name in drawn]
    captions = [f"*{FIGURES[name][1]}.*" for name in drawn]
    parts = [text for pair in zip(images, captions, strict=True) for text in pair]
    insert(PAGE, "figures", "\n\n".join(parts))


def write_ablation(table: str, conditions: str) -> None:
    """Write the table of the ablation."""
    insert(PAGE, "ablation", f"{conditions} of {DOFS}.\n\n{table}")
