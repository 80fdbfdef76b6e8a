"""What a model is given and what it gives back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config

Floats = NDArray[np.float64]

SWEEP = 0.9
"""Share of the command's range after which the start of a record counts as forgotten."""


@dataclass(frozen=True, eq=False)
class Task:
    """One record, and what may be known of it beforehand.

    Attributes:
        command: (n,) actuator position, any unit.
        measured: (n,) tip position, any unit; NaN where the tip was not seen.
        half: First sample of the second half, which is the one that counts.
        gain: Tip travel per command travel in contact, if it is known.
        update_distance: tau of Eqs. (4)-(6) in the tip's unit, if it is given.
        config: Of the on-line estimators; they are set as those of insertion.
    """

    command: Floats
    measured: Floats
    half: int
    gain: float | None
    update_distance: float | None
    config: Config

    @property
    def first_half(self) -> tuple[Floats, Floats]:
        """Command and measured, what an off-line fit may see."""
        return self.command[: self.half], self.measured[: self.half]


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a model says about a record.

    Attributes:
        tip: (n,) predicted tip, the tip's unit; NaN where the model says nothing.
        parameters: Of the model as fitted, or as they are at the end, in words and numbers.
        traces: Further signals (n,), by name: what an on-line model knew after each sample.
    """

    tip: Floats
    parameters: Mapping[str, Any]
    traces: Mapping[str, Floats] = field(default_factory=dict)


def seen(measured: Floats) -> NDArray[np.bool_]:
    """(n,) where the tip was seen."""
    return np.isfinite(measured)


def fitted(command: Floats, measured: Floats) -> NDArray[np.bool_]:
    """(n,) samples an off-line fit of hysteresis goes by: tip seen, start forgotten.

    What the instrument did before the record still shows until the command has crossed its range
    once: a play of radius r has forgotten it after a sweep of 2 r. So the samples before the
    command has swept `SWEEP` of its range are left out, unless more than half would be.
    """
    swept = np.maximum.accumulate(command) - np.minimum.accumulate(command)
    where = seen(measured)
    after = where & (swept >= SWEEP * np.ptp(command))
    return after if 2 * np.count_nonzero(after) >= np.count_nonzero(where) else where


def line(x: Floats, y: Floats, gain: float | None = None) -> tuple[float, float]:
    """Gain and offset of y = gain x + offset by least squares; of the offset only if gain is given.

    Without movement in x the gain is 0.
    """
    middle_x, middle_y = float(x.mean()), float(y.mean())
    if gain is None:
        away = x - middle_x
        power = float(away @ away)
        gain = float(away @ (y - middle_y)) / power if power > 0 else 0.0
    return gain, middle_y - gain * middle_x
