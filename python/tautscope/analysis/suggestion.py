"""Settings of a degree of freedom that a record suggests, to paste into a configuration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tautscope.analysis.identification import Identification
from tautscope.analysis.models.online import UPDATE_SHARE
from tautscope.runs.records import Record
from tautscope.runs.units import ANGLES, LENGTHS

GAIN_TOLERANCE = 0.05


@dataclass(frozen=True)
class Suggestion:
    """Settings of one DOF, `tautscope.config.DofConfig`.

    Attributes:
        dofs: DOFs that have the tip's unit; all if the file does not name it.
        unit: Of the values: "m" or "rad", or that of the tip if it is unknown ("").
        values: Setting -> value.
        notes: What a person has to check.
    """

    dofs: tuple[str, ...]
    unit: str
    values: dict[str, float]
    notes: tuple[str, ...]

    def to_toml(self) -> str:
        """A section of a configuration."""
        notes = list(self.notes)
        if len(self.dofs) > 1:
            notes.insert(0, f"or {', '.join(f'[{dof}]' for dof in self.dofs[1:])}")
        lines = [f"[{self.dofs[0]}]", *(f"# {note}" for note in notes)]
        lines += [f"{name} = {value:.4g}" for name, value in self.values.items()]
        return "\n".join(lines)


def suggest_settings(record: Record, found: Identification) -> Suggestion:
    """Settings by the slack that was identified.

    The update distance is 1 % of the travel, the deviation before the first image half the width.
    Offsets of one sign mean that the zeros of motor and tip differ; the offsets are then those
    about their middle, which is noted. A smaller difference stays in them.
    """
    gain, width = found.gain, found.width.value
    unit = record.units[1]
    notes: list[str] = []
    dofs: tuple[str, ...]
    if unit in LENGTHS:
        dofs, scale, si = ("insertion",), LENGTHS[unit], "m"
    elif unit in ANGLES:
        dofs, scale, si = ("rotation", "bending"), ANGLES[unit], "rad"
    else:
        dofs, scale, si = ("insertion", "rotation", "bending"), 1.0, ""
        notes.append("in the tip's unit, which the file does not name: convert to m or rad")
    if abs(gain - 1) > GAIN_TOLERANCE:
        notes.append(f"the tip moves {gain:.3g} times as far as the motor: the loop assumes 1")
    minus, plus = -width / 2 - found.offset, width / 2 - found.offset
    if not minus <= 0 <= plus:
        middle = (minus + plus) / 2
        notes.append(f"the zeros of motor and tip differ by {scale * middle:.4g}: set the motor's")
        minus, plus = minus - middle, plus - middle
    travel = abs(gain) * float(np.ptp(record.command))
    values = {
        "update_distance": UPDATE_SHARE * travel,
        "start_deviation": width / 2,
        "delta_minus": minus,
        "delta_plus": plus,
    }
    scaled = {name: scale * value for name, value in values.items()}
    return Suggestion(dofs, si, scaled, tuple(notes))
