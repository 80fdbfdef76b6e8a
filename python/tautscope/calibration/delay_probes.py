"""The two probes of `tautscope.calibration.delay`: scores of a delay, and corrections by parts."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tautscope._core import Play
from tautscope.dof import Dof

Floats = NDArray[np.float64]

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
        dof: The DOF.
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
        start = float(self.motor[0])
        plays = [
            Play(delta_minus=-r * self.range, delta_plus=r * self.range, output=start)
            for r in RADII
        ]
        self.plays = np.stack([play.run(self.motor) for play in plays], axis=1)
        self.motions = list(_motions(times, self.motor, 0.4 * LEAST_TRAVEL * self.range))
        self.turns = list(self._turn_windows())

    def thinned(self, stride: int) -> Signal:
        """The same with every ``stride``-th image, for a first search."""
        new = object.__new__(Signal)
        new.__dict__ = self.__dict__ | {
            "stamps": self.stamps[::stride],
            "tip": self.tip[::stride],
        }
        return new

    def _turn_windows(self) -> Iterator[tuple[int, int, int]]:
        """First, turning and last index of the motor around each end of a motion."""
        c, t, travel = self.motor, self.times, WINDOW * self.range
        for k, direction in _turning_points(c, LEAST_TRAVEL * self.range):
            back = direction * (c[k] - c)
            near = (back >= -0.005 * self.range) & (back <= travel) & (np.abs(t - t[k]) < LONGEST)
            outside = np.flatnonzero(~near)
            after = int(np.searchsorted(outside, k))
            first = int(outside[after - 1]) + 1 if after else 0
            last = int(outside[after]) - 1 if after < len(outside) else len(c) - 1
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
    is_moving = np.cumsum(moves) > 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_moving, [False]]).astype(int)))
    for first, end in edges.reshape(-1, 2):
        if times[min(end, len(times) - 1)] - times[first] > 2.0:
            yield int(first), int(min(end, len(times) - 1))


@dataclass(frozen=True, eq=False)
class Fit:
    """A fit of the tip at a delay.

    Attributes:
        dof: The DOF.
        left: Sum of squares of the residual.
        total: The same of the tip, about the mean of each stretch.
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
    centred: list[Floats] = []
    lines: list[Floats] = []
    tips: list[Floats] = []
    chosen: list[NDArray[np.int64]] = []
    for first, last in signal.motions:
        a, b = np.searchsorted(shown, (signal.times[first], signal.times[last]))
        if b - a < LEAST_IMAGES:
            continue
        x = shown[a:b]
        after = np.clip(np.searchsorted(signal.times, x), 1, len(signal.times) - 1)
        share = (x - signal.times[after - 1]) / (signal.times[after] - signal.times[after - 1])
        table = signal.plays[after - 1] + share[:, None] * (
            signal.plays[after] - signal.plays[after - 1]
        )
        line = np.interp(x, signal.times, signal.motor)
        centred.append(table - table.mean(axis=0))
        lines.append(line - line.mean())
        tips.append(signal.tip[a:b] - signal.tip[a:b].mean())
        chosen.append(np.arange(a, b))
    if not tips:
        return None
    table, line, tip = np.concatenate(centred), np.concatenate(lines), np.concatenate(tips)
    size = float(np.linalg.norm(line))
    total = float(tip @ tip)
    if size == 0 or total == 0:
        return None
    unit = line / size
    table = table - np.outer(unit, unit @ table)
    rest = tip - unit * (unit @ tip)
    power = np.maximum((table * table).sum(axis=0), 1e-9 * len(tip) * signal.range**2)
    gained = (table.T @ rest) ** 2 / power
    best = int(np.argmax(gained))
    weight = float(table[:, best] @ rest / power[best])
    # The part of the play along the line was taken off the table.
    along = unit @ np.concatenate(centred)[:, best]
    gain = float(unit @ tip - weight * along) / size
    left = float(rest @ rest - gained[best])
    parts: list[Part] = []
    if by_parts:
        index = np.concatenate(chosen)
        motion = gain * signal.motor + weight * signal.plays[:, best]
        slope = _slope(signal.times, motion, shown[index])
        at = 0
        for group in tips:
            slope[at : at + len(group)] -= slope[at : at + len(group)].mean()
            at += len(group)
        basis, _ = np.linalg.qr(np.column_stack([line, table[:, best]]))
        slope -= basis @ (basis.T @ slope)
        residual = rest - weight * table[:, best]
        parts = _block_parts(signal, signal.stamps[index], residual, slope)
    return Fit(signal.dof, left, total, len(tip), gain + weight, parts)


def _block_parts(signal: Signal, stamps: Floats, residual: Floats, slope: Floats) -> list[Part]:
    """Parts of `BLOCK` seconds, from the residual and its change with the delay."""
    variance = float(residual @ residual) / len(residual)
    parts: list[Part] = []
    ends = np.flatnonzero(np.diff(stamps // BLOCK) > 0) + 1
    for block in np.split(np.arange(len(stamps)), ends):
        power = float(slope[block] @ slope[block])
        if len(block) >= LEAST_IMAGES and power > 0:
            correction = float(residual[block] @ slope[block]) / power
            strength = power / signal.range**2
            parts.append((float(stamps[block].mean()), correction, power / variance, strength))
    return parts


def fit_turning_points(signal: Signal, shown: Floats, *, by_parts: bool = False) -> Fit | None:
    """Fit the tip around each turning point by itself; arguments as `fit_model`."""
    left = total = 0.0
    count = 0
    parts: list[Part] = []
    slopes: list[float] = []
    for first, turn, last in signal.turns:
        a, b = np.searchsorted(shown, (signal.times[first], signal.times[last]))
        if b - a < LEAST_IMAGES:
            continue
        x = shown[a:b]
        around = slice(max(first - 1, 0), last + 2)
        times = signal.times[around]
        moved = np.interp(x, times, signal.motor[around] - signal.motor[turn])
        before = np.where(x < signal.times[turn], moved, 0.0)
        columns = [before, moved - before]
        columns += [np.interp(x, times, other[around]) for other in signal.others.T]
        table = np.stack(columns, axis=1)
        table -= table.mean(axis=0)
        tip = signal.tip[a:b] - signal.tip[a:b].mean()
        total += float(tip @ tip)
        count += len(tip)
        # Coupled to the others, the tip moves with them; what they explain is left out.
        basis = _basis(table[:, 2:])
        own = table[:, :2] - basis @ (basis.T @ table[:, :2])
        rest = tip - basis @ (basis.T @ tip)
        gains = _falling_gains(own, rest)
        residual = rest - own @ gains
        left += float(residual @ residual)
        slopes.append(float(gains[0]))
        if by_parts and gains[0] > 0:
            displacement = signal.motor[around] - signal.motor[turn]
            side = np.where(times < signal.times[turn], gains[0], gains[1])
            slope = _slope(times, side * displacement, x)
            slope -= slope.mean()
            basis = _basis(table)
            slope -= basis @ (basis.T @ slope)
            power = float(slope @ slope)
            noise = float(residual @ residual) / len(tip) + 1e-6 * signal.range**2
            if power > 0:
                stamp = float(signal.stamps[a:b].mean())
                strength = power / signal.range**2
                parts.append((stamp, float(residual @ slope) / power, power / noise, strength))
    if count == 0 or total == 0:
        return None
    return Fit(signal.dof, left, total, count, float(np.median(slopes)), parts)


def _slope(times: Floats, motion: Floats, x: Floats) -> Floats:
    """Change of a motion, as the images show it, with the delay [per s]."""
    ahead = np.interp(x + _DIFFERENCE, times, motion)
    behind = np.interp(x - _DIFFERENCE, times, motion)
    return np.asarray((behind - ahead) / (2 * _DIFFERENCE), dtype=np.float64)


def _basis(table: Floats) -> Floats:
    """Orthonormal basis of the columns, without those that are (nearly) constant."""
    size = np.linalg.norm(table, axis=0)
    return np.linalg.qr(table[:, size > 1e-9 * (size.max(initial=0.0) + 1e-300)])[0]


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
