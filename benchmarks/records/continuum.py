"""Records of a real tendon-driven continuum robot, which are not in the repository.

Three segments of three tendons, moved one at a time or in pairs; each motion has two axes. A record
is one axis of one motion: the command is the servos' projection on a principal axis of their
motion, the tip its projection on the direction in which it follows this command. The other axis
moves at the same time, and its coupling is a disturbance.
"""

import csv
import re

import numpy as np
from common.paths import DATA
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FILE = DATA / "opencr" / "ftdcr_v4_keypoints.csv"
MOTIONS = (
    *(f"seg{number}" for number in (1, 2, 3)),
    *(f"pair{pair}_{sense}" for pair in (12, 13, 23) for sense in ("same", "opp")),
)
"""Labels of the motions: one segment, or two in the same and in opposite directions."""
AXES = (1, 2)
RECORDS = {
    f"continuum {motion.replace('_', ' ')}, axis {axis}": (motion, axis)
    for motion in MOTIONS
    for axis in AXES
}


def robots() -> list[str]:
    """Names of the records; none if there is no file."""
    return list(RECORDS) if FILE.exists() else []


def read(name: str) -> tuple[Floats, Floats]:
    """Servos and tip [mm], (n,) each, of a record."""
    motion, axis = RECORDS[name]
    with FILE.open(encoding="utf-8", newline="") as file:
        rows = [
            row
            for row in csv.DictReader(file)
            if re.match(rf"rep\d+_{motion}_", row["pattern_label"])
        ]

    def columns(*names: str) -> Floats:
        values = np.array([[float(row[each]) for each in names] for row in rows])
        return np.asarray(values - values.mean(axis=0))

    servos = columns(*(f"servo_{number}_mm" for number in range(1, 10)))
    tip = columns("tip_x", "tip_y", "tip_z")
    direction = np.linalg.svd(servos, full_matrices=False)[2][axis - 1]
    command = servos @ direction
    follows = tip.T @ command
    return command, tip @ (follows / np.linalg.norm(follows))
