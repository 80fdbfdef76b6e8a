"""Plays of a delayed command, fitted to a record: gain, offset and drift by least squares."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tautscope.analysis.models.constant_play import operator
from tautscope.analysis.models.task import Floats, extremes, fit_samples

SAMPLES = 4000
"""Of a longer record, so many tips are in the fit, and those of up to four times as many samples,
evenly over the record."""
_PLAYS = np.linspace(-1, 1, 7)
_TURN = 0.1
"""Motions below this share of the command's range are no strokes."""


@dataclass(frozen=True)
class Shape:
    """Plays of half widths in r (1 - k) .. r (1 + k), of a command delayed by d."""

    radius: float
    rounding: float
    delay: float

    @property
    def half_widths(self) -> Floats:
        """Of the plays."""
        plays = _PLAYS if self.rounding else np.zeros(1)
        return np.asarray(self.radius * (1 + self.rounding * plays))


class Signals:
    """Samples of a record for a fit, decimated.

    Args:
        time: (n,), never decreasing.
        command: (n,).
        measured: (n,), NaN where the tip is not known.
    """

    def __init__(self, time: Floats, command: Floats, measured: Floats) -> None:
        seen = np.flatnonzero(np.isfinite(measured))
        size = -(-len(command) // (4 * SAMPLES))
        knots = extremes(command, size)
        self.all_times, self.all_commands = time[knots], command[knots]
        kept = np.union1d(seen[:: -(-len(seen) // SAMPLES)], np.arange(0, len(command), size))
        self.time, self.measured = time[kept], measured[kept]
        self.extent = float(np.ptp(command))
        self.resolution = resolution(measured[seen])
        at = time[turns(command, _TURN * self.extent)]
        strokes = np.diff(at)
        duration = float(time[-1] - time[0])
        self.stroke = float(np.median(strokes)) if len(strokes) else duration / 10
        self.longest_delay = max(self.stroke / 2, 1e-9)
        self.where = np.flatnonzero(fit_samples(command[kept], self.measured))
        self.target = self.measured[self.where]
        at_once = np.linspace(-1, 1, len(kept))
        x = 2 * (self.time - time[0]) / duration - 1 if duration else at_once
        fitted = x[self.where]
        x = np.clip(x, fitted[0], fitted[-1])  # a polynomial says nothing outside
        degree = 3 if len(at) >= 12 else 1
        self.drifts = np.polynomial.legendre.legvander(x, degree)
        # As many as successive shapes share: a search varies one parameter at a time.
        self._late = lru_cache(9)(lambda delay: self._delayed(self.time - delay))
        self._play = lru_cache(len(_PLAYS))(lambda r: operator(self.all_commands, r, 0.0))

    def output(self, shape: Shape, times: Floats | None = None) -> Floats:
        """P(c(t - d)) at the samples or other times; between its samples c is monotonic."""
        if times is None:
            delayed, last = self._late(shape.delay)
        else:
            delayed, last = self._delayed(times - shape.delay)
        plays = [
            np.minimum(np.maximum(self._play(r)[last], delayed - r), delayed + r)
            for r in shape.half_widths.tolist()
        ]
        return np.asarray(np.mean(plays, axis=0))

    def _delayed(self, at: Floats) -> tuple[Floats, NDArray[np.intp]]:
        """The command at times, and the last of its samples."""
        last = np.searchsorted(self.all_times, at, side="right") - 1
        return np.interp(at, self.all_times, self.all_commands), np.maximum(last, 0)

    def columns(self, shape: Shape) -> Floats:
        """Regressors of gain, offset and drift."""
        return np.asarray(np.column_stack([self.output(shape), self.drifts]))

    def lag_error(self) -> float:
        """RMS error of the best first-order lag, with a gain and drift, but without slack."""
        from scipy.signal import lfilter  # noqa: PLC0415

        grid = np.linspace(self.all_times[0], self.all_times[-1], 4 * SAMPLES)
        command = np.interp(grid, self.all_times, self.all_commands)
        least = np.inf
        for constant in self.stroke * np.geomspace(0.01, 1, 25):
            memory = float(np.exp((grid[0] - grid[1]) / constant))
            lagged = lfilter([1 - memory], [1, -memory], command - command[0])
            columns = np.column_stack([np.interp(self.time, grid, lagged), self.drifts])
            _, residual = self.regress(columns)
            least = min(least, float(np.sqrt(np.mean(residual**2))))
        return least

    def solve(self, shape: Shape) -> tuple[Floats, Floats]:
        """Weights of the regressors, and residual."""
        return self.regress(self.columns(shape))

    def regress(self, columns: Floats) -> tuple[Floats, Floats]:
        """Weights of regressors (n, m) by least squares, and residual."""
        columns = columns[self.where]
        scale = np.linalg.norm(columns, axis=0) + 1e-300
        scaled = columns / scale
        gram = scaled.T @ scaled
        weights = np.linalg.lstsq(gram, scaled.T @ self.target, rcond=1e-12)[0] / scale
        return weights, columns @ weights - self.target


def resolution(values: Floats) -> float:
    """Least step between values that differ by more than rounding; infinite if all are equal."""
    steps = np.diff(np.unique(values))
    return float(np.min(steps[steps > 1e-9 * np.sum(steps)], initial=np.inf))


def turns(values: Floats, least: float) -> NDArray[np.intp]:
    """Indices at which a signal reverses by more than `least`, after the fact."""
    moved = operator(values, least / 2, 0.0) if least > 0 else values
    steps = np.sign(np.diff(moved))
    at = np.flatnonzero(steps)
    return np.asarray(at[1:][steps[at[1:]] != steps[at[:-1]]])
