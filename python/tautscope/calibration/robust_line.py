"""A line through groups of points, some of which are wrong."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Line:
    """A line and its standard deviations, in the unit of y, the slope in that of y over x."""

    value: float
    value_std: float
    slope: float
    slope_std: float


def robust_line(x: Floats, y: Floats, weight: Floats, group: Floats, *, own_levels: bool) -> Line:
    """Value at x = 0 and slope of a line by least squares with Huber's weights.

    Each group has a scatter and, if asked for, a level of its own; the value is the mean of these.
    """
    members = np.unique(group)[None, :] == group[:, None]
    levels = members if own_levels else np.ones((len(x), 1))
    design = np.column_stack([levels, x])
    w = weight / weight.sum()
    for _ in range(10):
        root = np.sqrt(w)
        found = np.linalg.lstsq(root[:, None] * design, root * y, rcond=1e-9)[0]
        residual = y - design @ found
        scale = members @ np.array(
            [max(1.4826 * np.median(np.abs(residual[each])), 0.004) for each in members.T]
        )
        size = members @ np.array([weight[each].sum() for each in members.T])
        huber = np.minimum(1.0, 1.5 * scale / np.maximum(np.abs(residual), 1e-12))
        w = weight / size / scale**2 * huber * (members @ members.sum(axis=0))
    inverse = np.linalg.pinv(design.T @ (w[:, None] * design))
    scattered = (w * residual)[:, None] * design
    freedom = max(len(x) - design.shape[1], 1)
    covariance = inverse @ (scattered.T @ scattered) @ inverse * len(x) / freedom
    mean = np.append(w @ levels / w.sum(), 0.0)
    return Line(
        float(mean @ found),
        math.sqrt(float(mean @ covariance @ mean)),
        float(found[-1]),
        math.sqrt(float(covariance[-1, -1])),
    )
