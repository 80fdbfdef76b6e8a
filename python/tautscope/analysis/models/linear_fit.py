"""A straight line between command and tip: no hysteresis."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from tautscope.analysis.models.task import Floats, Prediction, Task, fit_line


@dataclass(frozen=True)
class LinearFit:
    """Tip = gain * command + offset.

    Attributes:
        gain: [tip's unit per command's unit].
        offset: [tip's unit].
    """

    gain: float
    offset: float

    def predict(self, command: Floats) -> Floats:
        """Tip (n,) for a command (n,)."""
        return self.gain * command + self.offset


def fit(command: Floats, measured: Floats, gain: float | None = None) -> LinearFit:
    """Fit by least squares; only the offset if the gain is given.

    Wrong as an estimate of the gain in contact: hysteresis flattens the line.
    """
    where = np.isfinite(measured)
    return LinearFit(*fit_line(command[where], measured[where], gain))


def run(task: Task) -> Prediction:
    """Fit to the first half, and predict."""
    found = fit(*task.first_half, task.gain)
    return Prediction(found.predict(task.command), asdict(found))
