"""The two probes of `tautscope.calibration.delay`: how well a delay explains the tip."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tautscope._core import Play
from tautscope.dof import Dof
from tautscope.loop.kinematics import Floats

RADII = np.linspace(0.0, 0.48, 49)[1:]
"""Half widths of the plays, as shares of the motor's range."""
LEAST_TRAVEL = 0.05
"""Smallest travel that is a motion, as a share of the motor's range."""
WINDOW, LONGEST = 0.15, 3.0
"""Travel of the motor on either side of a turning point, as a share of its range, and time [s]."""
BLOCK = 4.0
"""Duration of a part of the record for the model [s]."""
LEAST_IMAGES = 6
"""In a part of the record."""
_DIFFERENCE = 0.02  # for derivatives [s]

Part = tuple[float, float, float, float]
"""Of a part of the record: stamp of its middle [s], correction of the delay [s], inverse variance
of the correction, and squared change of the tip per second of delay over the squared range."""


class Signal:
    """Motor and tip of one DOF, and what does not depend on the delay.

    Args:
        times: (n,) of the motor [s], increasing.
        motors: (n, 3) positions of all motors.
        dof: Which of these.
        stamps: (m,) of the images [s].
        tip: (m,) measured tip; NaN where it is unknown.
    """

    def __init__(
        self, times: Floats, motors: Floats, dof: Dof, stamps: Floats, tip: Floats
    ) -> None:
        seen = np.isfinite(tip)
        self.dof, self.times, self.motor = dof, times, motors[:, dof]
        self.stamps, self.tip = stamps[seen], tip[seen]
        self.range = float(np.ptp(self.motor))
        others = np.delete(motors, dof, axis=1)
        self.others = others[:, np.ptp(others, axis=0) > 0]
        start, radii = float(self.motor[0]), self.range * RADII
        plays = [Play(delta_minus=-r, delta_plus=r, output=start) for r in radii]
        self.table = np.stack([self.motor, *(play.run(self.motor) for play in plays)], axis=1)
        """(n, 1 + plays) the motor and its plays."""
        self.motions = list(_motions(times, self.motor, 0.4 * LEAST_TRAVEL * self.range))
        self.turns = list(self._turn_windows())

    def thinned(self, stride: int) -> Signal:
        """The same with every ``stride``-th image, for a first search."""
        new = copy(self)
        new.stamps, new.tip = self.stamps[::stride], self.tip[::stride]
        return new

    def images(self, shown: Floats, first: int, last: int) -> slice | None:
        """The images that show the motor between two of its indices; None if they are too few."""
        a, b = np.searchsorted(shown, self.times[[first, last]])
        return slice(a, b) if b - a >= LEAST_IMAGES else None

    def _turn_windows(self) -> Iterator[tuple[int, int, int]]:
        """First, turning and last index of the motor around each end of a motion."""
        c, t, travel = self.motor, self.times, WINDOW * self.range
        for k, direction in _turning_points(c, LEAST_TRAVEL * self.range):
            back = direction * (c[k] - c)
            near = (back >= -0.005 * self.range) & (back <= travel) & (np.abs(t - t[k]) < LONGEST)
            outside = np.flatnonzero(np.concatenate([[True], ~near, [True]])) - 1
            after = int(np.searchsorted(outside, k))
            first, last = int(outside[after - 1]) + 1, int(outside[after]) - 1
            if back[first] > 0.6 * travel:
                yield first, k, last


def _turning_points(motor: Floats, least: float) -> Iterator[tuple[int, int]]:
    """Index of each turning point between motions of at least `least`, and direction before it."""
    direction = high = low = 0
    for k, value in enumerate(motor.tolist()):
        high = k if value > motor[high] else high
        low = k if value < motor[low] else low
        if direction >= 0 and value < motor[high] - least:
            if direction > 0:
                yield high, 1
            direction, low = -1, k
        elif direction <= 0 and value > motor[low] + least:
            if direction < 0:
                yield low, -1
            direction, high = 1, k


def _motions(times: Floats, motor: Floats, least: float) -> Iterator[tuple[int, int]]:
    """First and last index of stretches in which the motor moves by `least` within a second."""
    ahead = np.minimum(np.searchsorted(times, times + 1.0), len(times) - 1)
    moves = np.zeros(len(times) + 1, dtype=np.int64)
    starts = np.flatnonzero(np.abs(motor[ahead] - motor) > least)
    np.add.at(moves, starts, 1)
    np.add.at(moves, ahead[starts], -1)
    edges = np.flatnonzero(np.diff(np.cumsum(moves) > 0, prepend=False, append=False))
    for first, end in edges.reshape(-1, 2):
        if times[min(end, len(times) - 1)] - times[first] > 2.0:
            yield int(first), int(min(end, len(times) - 1))


@dataclass(frozen=True, eq=False)
class Fit:
    """A fit of the tip at a delay.

    Attributes:
        left, total: Sums of squares of the residual, and of the tip about the mean of each stretch.
        count: Number of tips.
        gain: Tip travel per motor travel in contact.
        parts: If asked for.
    """

    dof: Dof
    left: float
    total: float
    count: int
    gain: float
    parts: list[Part]


def fit_model(signal: Signal, shown: Floats, *, by_parts: bool = False) -> Fit | None:
    """Fit gain, play and an offset per motion; `shown` (m,) is the motor's time of each image [s].

    None if too few images show a motion.
    """
    groups = [
        np.arange(len(shown))[images]
        for first, last in signal.motions
        if (images := signal.images(shown, first, last)) is not None
    ]
    if not groups:
        return None
    index = np.concatenate(groups)
    table = _centred(_interpolated(shown[index], signal.times, signal.table), groups)
    tip = _centred(signal.tip[index], groups)
    line, plays, total = table[:, :1], table[:, 1:], float(tip @ tip)
    if total == 0 or not line.any():
        return None
    own, rest = _without(plays, line), _without(tip, line)
    power = np.maximum((own * own).sum(axis=0), 1e-9 * len(tip) * signal.range**2)
    used = [0, 1 + int(np.argmax((own.T @ rest) ** 2 / power))]
    gains = np.linalg.lstsq(table[:, used], tip, rcond=1e-9)[0]
    residual = tip - table[:, used] @ gains
    left, parts = float(residual @ residual), []
    if by_parts:
        slope = _slope(signal.times, signal.table[:, used] @ gains, shown[index])
        slope = _without(_centred(slope, groups), table[:, used])
        stamps = signal.stamps[index]
        ends = np.flatnonzero(np.diff(stamps // BLOCK) > 0) + 1
        columns = (np.split(each, ends) for each in (stamps, residual, slope))
        for at, rest, change in zip(*columns, strict=True):
            if len(at) >= LEAST_IMAGES:
                parts += _part(signal, at, rest, change, left / len(tip))
    return Fit(signal.dof, left, total, len(tip), float(gains.sum()), parts)


def fit_turning_points(signal: Signal, shown: Floats, *, by_parts: bool = False) -> Fit | None:
    """Fit the tip around each turning point by itself; arguments as `fit_model`."""
    left = total = 0.0
    count = 0
    parts: list[Part] = []
    gains_before: list[float] = []
    for first, turn, last in signal.turns:
        images = signal.images(shown, first, last)
        if images is None:
            continue
        x = shown[images]
        around = slice(max(first - 1, 0), last + 2)
        times, motor = signal.times[around], signal.motor[around] - signal.motor[turn]
        moved = np.interp(x, times, motor)
        before = np.where(x < signal.times[turn], moved, 0.0)
        others = [np.interp(x, times, other[around]) for other in signal.others.T]
        table = np.stack([before, moved - before, *others], axis=1)
        table -= table.mean(axis=0)
        tip = signal.tip[images] - signal.tip[images].mean()
        total += float(tip @ tip)
        count += len(tip)
        # Coupled to the others, the tip moves with them; what they explain is left out.
        own, rest = _without(table[:, :2], table[:, 2:]), _without(tip, table[:, 2:])
        gains = _falling_gains(own, rest)
        residual = rest - own @ gains
        left += float(residual @ residual)
        gains_before.append(float(gains[0]))
        if by_parts and gains[0] > 0:
            side = np.where(times < signal.times[turn], gains[0], gains[1])
            slope = _slope(times, side * motor, x)
            slope = _without(slope - slope.mean(), table)
            noise = float(residual @ residual) / len(tip) + 1e-6 * signal.range**2
            parts += _part(signal, signal.stamps[images], residual, slope, noise)
    if count == 0 or total == 0:
        return None
    return Fit(signal.dof, left, total, count, float(np.median(gains_before)), parts)


def _part(
    signal: Signal, stamps: Floats, residual: Floats, slope: Floats, variance: float
) -> list[Part]:
    """A part of the record from its residual and the change of this with the delay, if any."""
    power = float(slope @ slope)
    if power == 0:
        return []
    correction = float(residual @ slope) / power
    return [(float(stamps.mean()), correction, power / variance, power / signal.range**2)]


def _interpolated(x: Floats, times: Floats, table: Floats) -> Floats:
    """Rows of a table (n, columns) at times `x`, by straight lines."""
    after = np.clip(np.searchsorted(times, x), 1, len(times) - 1)
    share = (x - times[after - 1]) / (times[after] - times[after - 1])
    return np.asarray(table[after - 1] + share[:, None] * (table[after] - table[after - 1]))


def _centred(values: Floats, groups: Sequence[NDArray[np.int64]]) -> Floats:
    """Values without the mean of each of successive groups."""
    ends = np.cumsum([len(group) for group in groups])[:-1]
    return np.concatenate([each - each.mean(axis=0) for each in np.split(values, ends)])


def _slope(times: Floats, motion: Floats, x: Floats) -> Floats:
    """Change of a motion, as the images show it, with the delay [per s]."""
    ahead = np.interp(x + _DIFFERENCE, times, motion)
    behind = np.interp(x - _DIFFERENCE, times, motion)
    return np.asarray((behind - ahead) / (2 * _DIFFERENCE), dtype=np.float64)


def _without(values: Floats, columns: Floats) -> Floats:
    """Values (m,) or (m, k) without what columns explain; those nearly constant explain nothing."""
    size = np.linalg.norm(columns, axis=0)
    basis, _ = np.linalg.qr(columns[:, size > 1e-9 * (size.max(initial=0.0) + 1e-300)])
    return np.asarray(values - basis @ (basis.T @ values))


def _falling_gains(table: Floats, tip: Floats) -> Floats:
    """Least squares of two gains with 0 <= second <= first: a tip cannot move more after a turn."""
    found = np.asarray(np.linalg.lstsq(table, tip, rcond=1e-6)[0], dtype=np.float64)
    if 0 <= found[1] <= found[0]:
        return found
    edges = []
    for direction in (np.array([1.0, 0.0]), np.array([1.0, 1.0])):
        line = table @ direction
        power = float(line @ line)
        gain = max(0.0, float(line @ tip) / power) if power > 0 else 0.0
        edges.append(gain * direction)
    return min(edges, key=lambda gains: float(((tip - table @ gains) ** 2).sum()))
