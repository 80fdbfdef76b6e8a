"""Prandtl-Ishlinskii: a superposition of plays, weights by non-negative least squares."""

from dataclasses import asdict, dataclass

import numpy as np

from tautscope.analysis.models.constant_play import operator
from tautscope.analysis.models.task import Floats, Prediction, Task, essential, fit_samples

OPERATORS = 32
"""Number of plays; their radii go evenly from 0 to just below half the command's range."""


@dataclass(frozen=True)
class PrandtlIshlinskii:
    """Tip = offset + direction * sum_i weights_i * P_i(command), P_i the play of radius r_i.

    Every play starts in the middle of its backlash.

    Attributes:
        radii: r_i, half the widths, the first 0 [command's unit].
        weights: At least 0 [tip's unit per command's unit].
        direction: 1, or -1 if the tip moves against the command.
        offset: [tip's unit].
    """

    radii: tuple[float, ...]
    weights: tuple[float, ...]
    direction: float
    offset: float

    def predict(self, command: Floats) -> Floats:
        """Tip (n,) for a command (n,)."""
        outputs = operators(command, self.radii)
        tip: Floats = self.offset + self.direction * (outputs @ np.array(self.weights))
        return tip


def fit(
    command: Floats, measured: Floats, radii: tuple[float, ...] | None = None
) -> PrandtlIshlinskii:
    """Weights and offset by non-negative least squares, for the better direction.

    Removing the means eliminates the offset exactly; a QR decomposition then reduces the problem to
    the number of plays without changing its solution.

    Args:
        command: (n,), not constant.
        measured: (n,), NaN where not measured.
        radii: [command's unit]; by default `OPERATORS` of them.
    """
    from scipy.optimize import nnls  # noqa: PLC0415  takes a third of a second

    if radii is None:
        largest = float(np.ptp(command)) / 2
        radii = tuple(largest * i / OPERATORS for i in range(OPERATORS))
    command, measured = essential(command, measured)
    where = fit_samples(command, measured)
    target = measured[where]
    outputs = operators(command, radii)[where]
    means = outputs.mean(axis=0)
    centred = np.column_stack([outputs - means, target - target.mean()])
    small = np.asarray(np.linalg.qr(centred, mode="r"))
    fits = [(nnls(sign * small[:, :-1], small[:, -1]), sign) for sign in (1.0, -1.0)]
    (weights, _), direction = min(fits, key=lambda fit: float(fit[0][1]))
    offset = float(target.mean() - direction * (means @ weights))
    return PrandtlIshlinskii(radii, tuple(weights.tolist()), direction, offset)


def operators(command: Floats, radii: tuple[float, ...]) -> Floats:
    """Outputs (n, m) of plays of m radii, each started in the middle of its backlash."""
    return np.array([operator(command, radius, 0.0) for radius in radii]).T


def run(task: Task) -> Prediction:
    """Fit to the first half, and predict; a given gain is not used, the weights contain it."""
    found = fit(*task.first_half)
    return Prediction(found.predict(task.command), asdict(found))
