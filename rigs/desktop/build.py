"""Write the STEP and STL files of the rig: `python rigs/desktop/build.py [FOLDER]`."""

from __future__ import annotations

import sys
from pathlib import Path

from assembly import PRINTED, assemble, for_printing
from build123d import Compound, export_step, export_stl

PLACE = Path(__file__).parents[2] / "target" / "desktop"
MIDDLE = (30.0, 0.0, 1.1)
"""Position of the stages in rig.step [mm, rad, rad]."""


def build(folder: Path) -> None:
    """Write each printed part as it lies on the bed, and the whole rig as rig.step."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in PRINTED:
        part = for_printing(name)
        export_step(part, folder / f"{name}.step")
        export_stl(part, folder / f"{name}.stl", tolerance=0.02, angular_tolerance=0.1)
    whole = assemble(*MIDDLE)
    for name, part in whole.items():
        part.label = name
    export_step(Compound(children=list(whole.values())), folder / "rig.step")


if __name__ == "__main__":
    build(Path(sys.argv[1]) if sys.argv[1:] else PLACE)
