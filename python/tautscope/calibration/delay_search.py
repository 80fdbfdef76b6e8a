"""Search of the delay and drift with which a probe explains a record best; see `delay`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.delay_probes import Fit, Signal
from tautscope.calibration.robust_line import robust_line
from tautscope.dof import Dof

Floats = NDArray[np.float64]

LARGEST_DRIFT = 0.02
"""[s/s]"""
LEAST_PARTS = 4
"""Parts of the record per probe."""
JUMP, JUMP_PARTS = 0.2, 4
"""Deviation [s] of so many successive parts from the line that is a jump."""
STRONG = 0.012
"""A tenth of a second changes the tip by 1 % of the motor's range, summed over the images."""
UNEXPLAINED = 0.5
"""Largest share of the tip's motion that a probe may leave unexplained."""
_STEP, _RATE = 0.05, 15.0  # of the first search: distance of delays [s], images per second
_GAP = 0.2  # of log scores: a second delay that is so close is as good as the first


@dataclass(frozen=True, slots=True)
class Probe:
    """Result of one probe.

    Attributes:
        delay: At the first image [s].
        middle: Delay in the middle of the record, where it is known best [s].
        delay_std: Standard deviation of `middle` [s].
        drift: [s/s].
        drift_std: Standard deviation of `drift` [s/s].
        parts: Number of parts of the record with a value of their own.
        unexplained: Share of the tip's motion that the fit does not explain.
        gains: (3,) travel of the tip over that of the motor in contact; NaN for a DOF that did not
            move, or was not seen.
    """

    delay: float
    middle: float
    delay_std: float
    drift: float
    drift_std: float
    parts: int
    unexplained: float
    gains: tuple[float, ...]


class DelaySearch:
    """Finds delay and drift of the best fit.

    Args:
        signals: Motor and tip of each DOF.
        stamps: (m,) of the images [s].
        limit: Largest magnitude of a delay that is searched [s].
    """

    def __init__(self, signals: list[Signal], stamps: Floats, limit: float) -> None:
        self._signals, self._limit = signals, limit
        self._first, self._middle = float(stamps[0]), float(stamps[-1] - stamps[0]) / 2
        rate = (len(stamps) - 1) / max(2 * self._middle, 1e-9)
        stride = max(1, round(rate / _RATE))
        self._thinned = [signal.thinned(stride) for signal in signals]

    def run(self, fit: Callable[..., Fit | None], *, is_model: bool) -> Probe | str:
        """The probe's result, or why it has none.

        The model has one minimum if there is an answer, and an error of its own in each DOF.
        """
        delays = np.arange(-self._limit, self._limit + _STEP / 2, _STEP)
        scores = np.array([self._score(fit, delay) for delay in delays])
        if not np.isfinite(scores).any():
            return "too few images around the motions of the motors"
        best = int(np.nanargmin(scores))
        if best in (0, len(delays) - 1):
            return f"no delay within {self._limit:g} s explains the record"
        far = np.abs(delays - delays[best]) > 1.0
        minima = (scores[1:-1] < scores[:-2]) & (scores[1:-1] < scores[2:]) & far[1:-1]
        rivals = delays[1:-1][minima & (scores[1:-1] < scores[best] + _GAP)]
        if is_model and len(rivals):
            return f"{delays[best]:.1f} s and {rivals[0]:.1f} s explain the record equally well"
        return self._refine(fit, float(delays[best]), own_levels=is_model)

    def _score(self, fit: Callable[..., Fit | None], delay: float) -> float:
        """Mean logarithm of the unexplained share, over the DOFs."""
        fits = self._fits(fit, self._thinned, delay, 0.0)
        count = sum(each.count for each in fits)
        if count == 0:
            return math.nan
        return sum(each.count * math.log(_share(each)) for each in fits) / count

    def _fits(
        self,
        fit: Callable[..., Fit | None],
        signals: list[Signal],
        delay: float,
        drift: float,
        **how: bool,
    ) -> list[Fit]:
        found = (
            fit(signal, signal.stamps - delay - drift * (signal.stamps - self._first), **how)
            for signal in signals
        )
        return [each for each in found if each is not None]

    def _refine(
        self, fit: Callable[..., Fit | None], delay: float, *, own_levels: bool
    ) -> Probe | str:
        drift = 0.0
        for _ in range(8):
            fits = self._fits(fit, self._signals, delay, drift, by_parts=True)
            parts = np.array(
                [(k, *part) for k, each in enumerate(fits) for part in each.parts]
            ).reshape(-1, 5)
            if len(parts) < LEAST_PARTS:
                return f"{len(parts)} motions to compare; at least {LEAST_PARTS} are needed"
            group, at, correction, weight, strength = parts.T
            x = at - self._first - self._middle
            line = robust_line(x, correction, weight, group, own_levels=own_levels)
            change = min(max(line.slope, -0.005), 0.005)
            drift += change
            delay += min(max(line.value, -0.2), 0.2) - change * self._middle
        middle = delay + drift * self._middle
        share = sum(_share(each) * each.count for each in fits) / sum(each.count for each in fits)
        if abs(drift) > LARGEST_DRIFT or abs(middle) > 1.2 * self._limit:
            return f"no delay within {self._limit:g} s explains the record"
        if share > UNEXPLAINED:
            return f"the motors do not explain {100 * share:.0f} % of the tip's motion"
        by_dof = {each.dof: each.gain for each in fits}
        gains = tuple(by_dof.get(dof, math.nan) for dof in Dof)
        if not own_levels and (jump := _jump(at, correction, strength)) > JUMP:
            return f"the delay changes by {jump:.2f} s within the record; are images missing?"
        return Probe(delay, middle, line.value_std, drift, line.slope_std, len(parts), share, gains)


def _jump(at: Floats, correction: Floats, strength: Floats) -> float:
    """Largest deviation from the line that `JUMP_PARTS` successive parts have in common [s].

    Only of parts that show it clearly: with a `strength` of at least `STRONG`.
    """
    order = np.argsort(at)
    strong = order[strength[order] >= STRONG]
    if len(strong) < JUMP_PARTS:
        return 0.0
    runs = np.lib.stride_tricks.sliding_window_view(correction[strong], JUMP_PARTS)
    return float(np.abs(np.sort(runs, axis=1)[:, 1:-1].mean(axis=1)).max())


def _share(fit: Fit) -> float:
    return max(fit.left / fit.total, 1e-12)
