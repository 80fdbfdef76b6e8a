"""Prandtl-Ishlinskii: a superposition of plays, weights by non-negative least squares."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from tautscope.analysis.models.constant_play import operator
from tautscope.analysis.models.task import Floats, Prediction, Task, fitted

OPERATORS = 32
"""Plays superposed; radii evenly from 0 to just below half the command's range."""


@dataclass(frozen=True)
class PrandtlIshlinskii:
    """Tip = offset + direction * sum_i weights_i * P_i(command), P_i the play of radius r_i.

    Every play begins in the middle of its slack.

    Attributes:
        radii: r_i, half the widths, the first 0 [command's unit].
        weights: Not below 0 [tip's unit per command's unit].
        direction: 1, or -1 where command and tip run against each other.
        offset: [tip's unit].
    """

    radii: tuple[float, ...]
    weights: tuple[float, ...]
    direction: float
    offset: float

    def predict(self, command: Floats) -> Floats:
        """Tip (n,) for a command (n,)."""
        outputs = _operators(command, self.radii)
        tip: Floats = self.offset + self.direction * (outputs @ np.array(self.weights))
        return tip


def fit(
    command: Floats, measured: Floats, radii: tuple[float, ...] | None = None
) -> PrandtlIshlinskii:
    """Weights and offset of least squares, weights not below 0, for the better direction.

    The offset is taken out by removing means, which is exact; a QR decomposition then makes the
    problem as small as the number of plays without changing its solution.

    Args:
        command: (n,), not constant.
        measured: (n,), NaN where not seen.
        radii: [command's unit]; without it `OPERATORS` of them.
    """
    from scipy.optimize import nnls  # noqa: PLC0415  takes a third of a second

    if radii is None:
        largest = float(np.ptp(command)) / 2
        radii = tuple(largest * i / OPERATORS for i in range(OPERATORS))
    where = fitted(command, measured)
    target = measured[where]
    outputs = _operators(command, radii)[where]
    means = outputs.mean(axis=0)
    centred = np.column_stack([outputs - means, target - target.mean()])
    small = np.asarray(np.linalg.qr(centred, mode="r"))
    ways = [(nnls(way * small[:, :-1], small[:, -1]), way) for way in (1.0, -1.0)]
    (weights, _), direction = min(ways, key=lambda found: float(found[0][1]))
    offset = float(target.mean() - direction * (means @ weights))
    return PrandtlIshlinskii(radii, tuple(weights.tolist()), direction, offset)


def _operators(command: Floats, radii: tuple[float, ...]) -> Floats:
    return np.column_stack([operator(command, radius, 0.0) for radius in radii])


def run(task: Task) -> Prediction:
    """Fitted to the first half; the weights hold the gain, so a given one is not used."""
    found = fit(*task.first_half)
    return Prediction(found.predict(task.command), asdict(found))
