"""Input and output of a model, and the least squares that several models share."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config

Floats = NDArray[np.float64]

SWEEP = 0.9
"""Share of its range that the command must have swept before a fit begins."""


@dataclass(frozen=True, eq=False)
class Task:
    """A record to predict, and prior knowledge of it.

    Attributes:
        command: (n,) actuator position, any unit.
        measured: (n,) tip position, any unit; NaN where it was not measured.
        half: First sample of the second half, over which the error is computed.
        gain: Tip travel per command travel in contact, if known.
        update_distance: tau of Eqs. (4)-(6) in the tip's unit, if given.
        config: Its insertion has the settings of the on-line estimators.
    """

    command: Floats
    measured: Floats
    half: int
    gain: float | None
    update_distance: float | None
    config: Config

    @property
    def first_half(self) -> tuple[Floats, Floats]:
        """Command and measured tip of the first half, for an off-line fit."""
        return self.command[: self.half], self.measured[: self.half]


@dataclass(frozen=True, eq=False)
class Prediction:
    """Prediction of a model for a record.

    Attributes:
        tip: (n,) predicted tip [tip's unit]; NaN where there is no prediction.
        parameters: Parameters by name, as fitted or as they are at the end of the record.
        traces: Further signals (n,) by name: estimates of an on-line model after each sample.
    """

    tip: Floats
    parameters: Mapping[str, Any]
    traces: Mapping[str, Floats] = field(default_factory=dict)


def last_seen(measured: Floats) -> NDArray[np.intp]:
    """(n,) index of the last measured tip before each sample; -1 if there is none."""
    at = np.where(np.isfinite(measured), np.arange(len(measured)), -1)
    return np.concatenate([[-1], np.maximum.accumulate(at)[:-1]])


def continued(predicted: Floats, measured: Floats) -> Floats:
    """Last measured tip plus the change of a prediction since then, (n,).

    Before the first measured tip the prediction is unchanged.
    """
    at = last_seen(measured)
    return predicted + np.where(at >= 0, (measured - predicted)[at], 0.0)


def extremes(values: Floats, size: int) -> NDArray[np.intp]:
    """Samples with the least and the largest value of each part of `size` samples, in order.

    The samples of a last, shorter part are all contained.
    """
    parts = len(values) // size
    blocks = values[: parts * size].reshape(parts, size)
    begins = size * np.arange(parts)
    ends = blocks.argmin(axis=1) + begins, blocks.argmax(axis=1) + begins
    return np.unique(np.concatenate([*ends, np.arange(parts * size, len(values))]))


def essential(command: Floats, measured: Floats) -> tuple[Floats, Floats]:
    """The samples with a tip, and those at which the command turns, stops or starts.

    The others have no effect on the output of any play at the samples with a tip.
    """
    steps = np.sign(np.diff(command))
    kept = np.isfinite(measured)
    kept[[0, -1]] = True
    kept[1:-1] |= steps[1:] != steps[:-1]
    return command[kept], measured[kept]


def fit_samples(command: Floats, measured: Floats) -> NDArray[np.bool_]:
    """(n,) the samples for an off-line fit of hysteresis: tip measured, start forgotten.

    Motion before the record affects the tip until the command has swept its range once: a play of
    radius r has forgotten it after a sweep of 2 r. The samples before a sweep of `SWEEP` of the
    range are therefore left out, unless these are more than half.
    """
    swept = np.maximum.accumulate(command) - np.minimum.accumulate(command)
    where = np.isfinite(measured)
    after = where & (swept >= SWEEP * np.ptp(command))
    return after if 2 * np.count_nonzero(after) >= np.count_nonzero(where) else where


def fit_line(x: Floats, y: Floats, gain: float | None = None) -> tuple[float, float]:
    """Gain and offset of y = gain x + offset by least squares; only the offset if gain is given.

    Without movement in x the gain is 0; samples without y (NaN) are left out.
    """
    known = np.isfinite(y)
    x, y = x[known], y[known]
    mean_x, mean_y = float(x.mean()), float(y.mean())
    if gain is None:
        centred = x - mean_x
        power = float(centred @ centred)
        gain = float(centred @ (y - mean_y)) / power if power > 0 else 0.0
    return gain, mean_y - gain * mean_x
