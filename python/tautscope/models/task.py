"""What a model is given and what it gives back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.config import DofConfig

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Task:
    """One record, and what may be known of it beforehand.

    Attributes:
        command: (n,) actuator position, any unit.
        measured: (n,) tip position, any unit; NaN where the tip was not seen.
        half: First sample of the second half, which is the one that counts.
        gain: Tip travel per command travel in contact, if it is known.
        update_distance: tau of Eqs. (4)-(6) in the tip's unit, if it is given.
        settings: Contact tolerance and smoothing factor of the on-line estimators.
    """

    command: Floats
    measured: Floats
    half: int
    gain: float | None
    update_distance: float | None
    settings: DofConfig

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
