"""What may go into the loop: finite numbers, as many as it takes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.errors import SignalError


def features_of(values: ArrayLike) -> NDArray[np.float64]:
    """Four numbers (4,) [px], both of a band NaN or both finite, and not all NaN.

    Raises:
        SignalError: It is something else.
    """
    features = np.asarray(values, dtype=np.float64) if np.shape(values) == (4,) else np.empty(0)
    lost = np.isnan(features).reshape(-1, 2).all(axis=1).repeat(2)
    if features.shape != (4,) or lost.all():
        return finite("features", values, (4,))
    finite("features", np.where(lost, 0.0, features), (4,))
    return features


def finite(field: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """As an array of this shape; `field` is what an error names.

    Raises:
        SignalError: It has another shape, or is not finite.
    """
    allowed = f"{shape[0]} finite numbers"
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise SignalError(field, values, allowed) from None
    if array.shape != shape or not np.isfinite(array).all():
        raise SignalError(field, array.tolist(), allowed)
    return array


def seconds(field: str, value: float) -> float:
    """A time [s]; `field` is what an error names.

    Raises:
        SignalError: It is no finite number.
    """
    if not isinstance(value, float | int | np.floating) or not math.isfinite(value):
        raise SignalError(field, value, "a finite number of seconds")
    return float(value)
