"""Figures of merit: loop width, reduction, start, overshoot; tracking, state and marker errors.

Arrays in, numbers out. A figure that the data do not determine is NaN.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.errors import SignalError

LEVELS = 41
"""Number of levels of y at which the width of a loop is measured."""
CENTRAL = 0.8
"""Share of y's range that the levels span, about its middle."""
DEADBAND = 0.05
"""Share of y's range by which y must exceed a level for a crossing to count as a passage."""
COVERAGE = 0.5
"""Share of the levels that y must pass both ways for a loop to have a width."""
SETTLED = 1.2
"""A period is settled when its width is at most this times the final one."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LoopWidth:
    """Width of a hysteresis loop, in the unit of x. ``float(width)`` is the mean width.

    Attributes:
        mean: Mean over the levels that y passes both ways.
        max: Width of the largest magnitude over these levels, with its sign.
        levels: (41,) values of y at which the width was measured.
        widths: (41,) width at each level; NaN where y does not pass both ways.
    """

    mean: float
    max: float
    levels: Floats
    widths: Floats

    def __float__(self) -> float:
        return self.mean

    def __repr__(self) -> str:
        passed = np.count_nonzero(np.isfinite(self.widths))
        levels = f"{passed} of {len(self.levels)} levels"
        return f"<LoopWidth: mean {self.mean:.4g}, largest {self.max:.4g}, {levels}>"


def loop_width(
    x: ArrayLike, y: ArrayLike, *, levels: int = LEVELS, central: float = CENTRAL
) -> LoopWidth:
    """Horizontal width of the hysteresis loop of output y over input x.

    At each level: x where y passes it rising, minus x where y passes it falling, each averaged
    over all passages and interpolated between samples. For a play, Eq. (1), this is exactly
    ``delta_plus - delta_minus``: positive when the output lags.

    Noise makes y cross a level several times in one passage. A passage therefore ends when y is
    more than 5 % of its range beyond the level; its position is the mean of its crossings.

    Args:
        x: (n,) input in order of time; pairs with a non-finite number are skipped.
        y: (n,) output, same length.
        levels: Number of levels.
        central: Share of y's range that they span.

    Returns:
        Mean and largest width; both NaN if y passes fewer than half of the levels both ways.

    Raises:
        SignalError: x and y are not one-dimensional and equally long.
    """
    x, y = _pair("x", x, "y", y)
    finite = np.isfinite(x) & np.isfinite(y)
    x, y = x[finite], y[finite]
    if len(y) < 2 or np.ptp(y) == 0:
        unknown = np.full(levels, np.nan)
        return LoopWidth(np.nan, np.nan, unknown, unknown)
    middle, half = (y.max() + y.min()) / 2, np.ptp(y) / 2
    at = np.linspace(middle - central * half, middle + central * half, levels)
    widths = np.array([_width_at(x, y - level, 2 * half * DEADBAND) for level in at])
    passed = widths[np.isfinite(widths)]
    if len(passed) < COVERAGE * levels:
        return LoopWidth(np.nan, np.nan, at, widths)
    return LoopWidth(float(passed.mean()), float(max(passed, key=abs)), at, widths)


def _width_at(x: Floats, height: Floats, deadband: float) -> float:
    """Mean x of the rising minus that of the falling passages of height through zero."""
    above = height >= 0
    before = np.flatnonzero(above[1:] != above[:-1])
    if len(before) < 2:
        return np.nan
    share = height[before] / (height[before] - height[before + 1])
    crossings = x[before] + share * (x[before + 1] - x[before])
    excursions = np.maximum.reduceat(np.abs(height), before + 1)
    excursions[-1] = np.inf  # the last crossing always counts
    passages: dict[bool, list[float]] = {True: [], False: []}
    side, first = bool(above[0]), 0
    for index in np.flatnonzero(excursions > deadband):
        arrived = bool(above[before[index] + 1])
        if arrived is not side:
            passages[arrived].append(float(crossings[first : index + 1].mean()))
        side, first = arrived, int(index) + 1
    if not (passages[True] and passages[False]):
        return np.nan
    return float(np.mean(passages[True]) - np.mean(passages[False]))


def reduction(uncompensated: float | LoopWidth, compensated: float | LoopWidth) -> float:
    """Reduction of hysteresis: 1 - |compensated| / uncompensated.

    Both are mean widths, or both maxima. The ideal of Eq. (2) is 1 - 1 / free_gain. NaN if the
    uncompensated width is not positive.
    """
    before, after = float(uncompensated), float(compensated)
    return 1.0 - abs(after) / before if before > 0 else np.nan


def start_periods(widths: ArrayLike) -> float:
    """Number of periods until the mean width stays within 1.2 times its final value.

    Args:
        widths: (periods,) mean width of each whole period, see `period_widths`; their absolute
            values count.

    Returns:
        Number of periods before the settled ones; NaN if the final width is not known.
    """
    values = np.abs(np.asarray(widths, dtype=np.float64))
    return until_within(values, 0.0, SETTLED * values[-1]) if values.size else np.nan


def period_widths(
    time: ArrayLike, x: ArrayLike, y: ArrayLike, *, start: float, period: float, periods: int
) -> Floats:
    """(periods,) mean loop width of each whole period of y over x from time `start`."""
    x, y = _pair("x", x, "y", y)
    x, time = _pair("x", x, "time", time)
    edges = np.searchsorted(time, start + period * np.arange(periods + 1))
    # One sample more than the period closes the loop.
    windows = (slice(first, last + 1) for first, last in pairwise(edges))
    return np.array([loop_width(x[window], y[window]).mean for window in windows])


def rms(errors: ArrayLike) -> float:
    """Root mean square of the finite errors; NaN if there is none."""
    values = np.asarray(errors, dtype=np.float64)
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if values.size else np.nan


def tracking_rms(reference: ArrayLike, tip: ArrayLike) -> float:
    """RMS of (tip - reference), in their unit."""
    return rms(np.subtract(*_pair("reference", reference, "tip", tip)))


def largest_error(reference: ArrayLike, tip: ArrayLike) -> float:
    """Largest |tip - reference|, in their unit; NaN if none is known."""
    errors = np.abs(np.subtract(*_pair("reference", reference, "tip", tip)))
    known = errors[np.isfinite(errors)]
    return float(known.max()) if known.size else np.nan


def creep(references: ArrayLike, tip: ArrayLike) -> float:
    """Travel of the tip (n,) while every reference of (n, 3) rests, in the unit of the tip.

    A sample counts if no reference changed since the one before it, and the tip is known at both.
    NaN if none does.
    """
    desired, actual = np.asarray(references, dtype=np.float64), np.asarray(tip, dtype=np.float64)
    if desired.ndim != 2 or desired.shape[:1] != actual.shape:
        allowed = f"a row (3,) for each sample of a tip (n,), here of shape {actual.shape}"
        raise SignalError("references", f"an array of shape {desired.shape}", allowed)
    rests = np.all(np.diff(desired, axis=0) == 0, axis=1)
    steps = np.abs(np.diff(actual))[rests]
    known = steps[np.isfinite(steps)]
    return float(known.sum()) if known.size else np.nan


def state_rms(estimate: ArrayLike, truth: ArrayLike) -> float:
    """RMS of (state_estimate - true_state at the capture time), one DOF, in its unit."""
    return rms(np.subtract(*_pair("estimate", estimate, "truth", truth)))


def tip_overspeed(time: ArrayLike, reference: ArrayLike, tip: ArrayLike) -> float:
    """99.9th percentile of |tip speed| over the peak of |reference speed|; 1 is ideal."""
    reference, tip = _pair("reference", reference, "tip", tip)
    reference, time = _pair("reference", reference, "time", time)
    steps = np.diff(time)
    if len(steps) == 0 or not np.all(steps > 0):
        return np.nan
    peak = np.max(np.abs(np.diff(reference)) / steps)
    speed = np.abs(np.diff(tip)) / steps
    speed = speed[np.isfinite(speed)]
    return float(np.percentile(speed, 99.9) / peak) if len(speed) and peak > 0 else np.nan


def actuator_gain(reference: ArrayLike, command: ArrayLike) -> float:
    """Largest |change of command| over |change of reference| in one tick.

    Infinite if the command moves while the reference is constant. Ticks whose reference moves less
    than 1e-9 of its largest step are skipped: they are rounding errors.
    """
    reference, command = _pair("reference", reference, "command", command)
    desired, actual = np.abs(np.diff(reference)), np.abs(np.diff(command))
    if np.any((desired == 0) & (actual > 0)):
        return np.inf
    moving = desired > 1e-9 * desired.max(initial=0.0)
    return float(np.max(actual[moving] / desired[moving])) if moving.any() else np.nan


def overshoot(reference: ArrayLike, tip: ArrayLike) -> float:
    """Largest overshoot of the tip over the reference in any stroke, in their unit.

    A stroke lasts from one reversal of the reference to the next. With the direction s = +-1 of
    the reference in it, and the tip position y0 at its start,

        overshoot = max over the stroke of min(s (y - u), s (y - y0))

    so a tip that is ahead only because it lagged in the stroke before does not count until it
    moves in the new direction.

    Args:
        reference: u (n,); a constant reference does not end the stroke.
        tip: y (n,).

    Returns:
        0 if the tip never overshoots; NaN if nothing moves or a value is not known.
    """
    reference, tip = _pair("reference", reference, "tip", tip)
    peaks = []
    for first, last in pairwise(_reversals(reference)):
        sign = np.sign(reference[last] - reference[first])
        stroke = slice(first, last + 1)
        ahead, moved = sign * (tip[stroke] - reference[stroke]), sign * (tip[stroke] - tip[first])
        peaks.append(np.minimum(ahead, moved).max())
    return float(np.max([0.0, *peaks])) if peaks else np.nan


def _reversals(signal: Floats) -> list[int]:
    """Indices of the reversals of a signal and of its two ends; empty if it never moves."""
    moving = np.flatnonzero(np.diff(signal))
    if len(moving) == 0:
        return []
    direction = np.sign(np.diff(signal)[moving])
    turns = moving[1:][direction[1:] != direction[:-1]]
    return [0, *turns.tolist(), len(signal) - 1]


def until_within(values: ArrayLike, target: float, tolerance: float) -> float:
    """Number of values, one per stroke or period, before they stay within a tolerance of a target.

    Args:
        values: (n,).
        target: In their unit.
        tolerance: Largest |value - target|, in their unit.

    Returns:
        0 if all are within it; NaN if the last is not, because the number is then not known.
    """
    errors = np.abs(np.asarray(values, dtype=np.float64) - target)
    outside = np.flatnonzero(~(errors <= tolerance))
    if errors.size == 0 or errors.size - 1 in outside:
        return np.nan
    return float(outside[-1] + 1) if outside.size else 0.0


def peak_to_peak(signal: ArrayLike) -> float:
    """Largest minus smallest value; NaN if one is not known or there is none."""
    values = np.asarray(signal, dtype=np.float64)
    return float(np.ptp(values)) if values.size else np.nan


def marker_errors(measured: ArrayLike, truth: ArrayLike) -> Floats:
    """(n, 2) distance between measured and true feature of markers A and B [px].

    Args:
        measured: (n, 4) measured features, x and y of A, then of B [px].
        truth: (n, 4) true features.
    """
    found, true = np.asarray(measured, np.float64), np.asarray(truth, np.float64)
    for name, each in (("measured", found), ("truth", true)):
        if each.shape != (*found.shape[:1], 4):
            raise SignalError(name, f"an array of shape {each.shape}", "arrays (n, 4) of one n")
    difference = found - true
    return np.asarray(np.hypot(difference[:, 0::2], difference[:, 1::2]))


def marker_rms(measured: ArrayLike, truth: ArrayLike) -> float:
    """RMS over frames and both markers of the distance from measured to true feature [px].

    Frames whose features or truth are not known (NaN) are skipped.
    """
    errors = marker_errors(measured, truth)
    return rms(errors[np.isfinite(errors).all(axis=1)].ravel())


def _pair(name_a: str, a: ArrayLike, name_b: str, b: ArrayLike) -> tuple[Floats, Floats]:
    first, second = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    for name, signal in ((name_a, first), (name_b, second)):
        if signal.ndim != 1:
            raise SignalError(name, f"an array of shape {signal.shape}", "a signal of shape (n,)")
    if len(first) != len(second):
        raise SignalError(name_b, f"{len(second)} samples", f"as many as {name_a}: {len(first)}")
    return first, second
