"""Records of real cable-driven tools, which are not in the repository."""

from itertools import permutations

import numpy as np
from common.paths import DATA
from numpy.typing import NDArray
from tautscope.runs.records import read_record

Floats = NDArray[np.float64]
FOLDER = DATA / "davinci_tools"
ROLLS = (1, 3, 5)
"""Settings of the wrist's roll under the same motion of the jaw."""
SPLICED = {"rolls " + ", ".join(map(str, order)): order for order in permutations(ROLLS)}
"""Records of the three rolls one after the other, in each order."""


def tools() -> list[str]:
    """Names of the records in the folder; none if there is no folder."""
    return sorted(file.stem for file in FOLDER.glob("*.csv"))


def read(name: str) -> tuple[Floats, Floats]:
    """Motor and jaw [deg], (n,) each, of a record or of spliced ones."""
    files = [f"tool4_roll{roll}_run000" for roll in SPLICED[name]] if name in SPLICED else [name]
    records = [read_record(FOLDER / f"{file}.csv", "motor_deg", "jaw_deg") for file in files]
    return (
        np.concatenate([record.command for record in records]),
        np.concatenate([record.measured for record in records]),
    )
