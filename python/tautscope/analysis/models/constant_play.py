"""A play with constant contact offsets, Eq. (1), fitted off-line."""

from dataclasses import asdict, dataclass

import numpy as np

from tautscope._core import Play
from tautscope.analysis.models.task import (
    SWEEP,
    Floats,
    Prediction,
    Task,
    essential,
    fit_line,
    fit_samples,
)

_LARGEST = SWEEP / 2
"""Largest radius, as a share of the command's range; at 0.5 the play never moves."""
_GRID = 32
"""Radii in the grid search."""


@dataclass(frozen=True)
class ConstantPlay:
    """Play of Eq. (1) with input gain * command; its output is the tip.

        gain c - delta_plus <= y <= gain c - delta_minus

    Both offsets contain the unknown offset between the zeros of command and tip.

    Attributes:
        gain: Tip travel per command travel in contact; negative for opposite directions.
        delta_minus: Contact offset, input minus output [tip's unit].
        delta_plus: Contact offset [tip's unit].
        start: Output before the first command [tip's unit].
    """

    gain: float
    delta_minus: float
    delta_plus: float
    start: float

    @property
    def width(self) -> float:
        """Backlash width [tip's unit]."""
        return self.delta_plus - self.delta_minus

    def predict(self, command: Floats) -> Floats:
        """Tip (n,) for a command (n,)."""
        play = Play(delta_minus=self.delta_minus, delta_plus=self.delta_plus, output=self.start)
        return play.run(self.gain * command)


def operator(command: Floats, radius: float, start: float) -> Floats:
    """Output (n,) of a play with offsets -radius and radius, in the command's unit.

    Args:
        command: (n,).
        radius: Half the width.
        start: In [-1, 1]; the output before the first command is command + start * radius: -1
            after a long increase, 1 after a long decrease.
    """
    begin = float(command[0]) + start * radius
    return Play(delta_minus=-radius, delta_plus=radius, output=begin).run(command)


def fit(command: Floats, measured: Floats, gain: float | None = None) -> ConstantPlay:
    """Fit by least squares.

    For a given radius and start, gain and offset are a linear problem. So the search is over radius
    and start: first a grid, because the error has plateaus, then `scipy.optimize.least_squares`.

    Args:
        command: (n,), not constant.
        measured: (n,), NaN where not measured.
        gain: Held fixed if given.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415  takes a third of a second

    command, measured = essential(command, measured)
    where = fit_samples(command, measured)
    target = measured[where]
    extent = float(np.ptp(command))

    def scaled(radius: float, start: float) -> tuple[float, float, Floats]:
        output = operator(command, radius, start)[where]
        slope, offset = fit_line(output, target, gain)
        return slope, offset, slope * output + offset - target

    def residual(parameters: Floats) -> Floats:
        return scaled(extent * parameters[0], parameters[1])[2]

    is_forgotten = np.ptp(command[: np.argmax(where) + 1]) >= SWEEP * extent
    grid = [
        np.array([share, start])
        for share in np.linspace(0, _LARGEST, _GRID)
        for start in ((0.0,) if is_forgotten else (0.0, -1.0, 1.0))
    ]
    best = min(grid, key=lambda parameters: float(np.sum(residual(parameters) ** 2)))
    bounds = (np.array([0.0, -1.0]), np.array([_LARGEST, 1.0]))
    inside = np.clip(best, bounds[0] + 1e-6, bounds[1] - 1e-6)
    share, start = least_squares(residual, inside, bounds=bounds, diff_step=1e-4).x.tolist()
    slope, offset, _ = scaled(extent * share, start)
    radius = abs(slope) * extent * share
    begin = slope * (command[0] + start * extent * share) + offset
    return ConstantPlay(slope, -radius - offset, radius - offset, float(begin))


def run(task: Task) -> Prediction:
    """Fit to the whole record: the lower bound of the error of any constant play."""
    found = fit(task.command, task.measured, task.gain)
    return Prediction(found.predict(task.command), asdict(found) | {"width": found.width})
