"""Checks of the numbers that go into the loop."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope._core import MOST_VALUES
from tautscope.errors import SignalError


def check_features(values: ArrayLike) -> NDArray[np.float64]:
    """Features (4,) [px], each band finite, or NaN if not found, not both; else a `SignalError`."""
    features = as_numbers("features", values, "4 finite numbers")
    if features.shape != (4,):
        return check_signal("features", values, (4,))
    lost = np.isnan(features).reshape(2, 2).all(axis=1).repeat(2)
    if lost.all():
        allowed = "None where neither band was found, NaN for the features of one"
        raise SignalError("features", features.tolist(), allowed)
    check_signal("features", np.where(lost, 0.0, features), (4,))
    return features


def check_signal(field: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Finite numbers as an array of this shape; else a `SignalError` that names `field`."""
    allowed = "finite numbers"
    allowed = f"{shape[0]} {allowed}" if len(shape) == 1 else f"an array {shape} of {allowed}"
    array = as_numbers(field, values, allowed)
    if array.shape != shape or not np.isfinite(array).all():
        raise SignalError(field, array.tolist(), allowed)
    return array


def check_time(field: str, value: float) -> float:
    """A finite time [s]; else a `SignalError` that names `field`."""
    try:
        if isinstance(value, float | int | np.floating | np.integer) and math.isfinite(value):
            return float(value)
    except OverflowError:
        pass
    raise SignalError(field, value, "a finite number of seconds")


def check_numbers(field: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Numbers of this shape, none infinite and not all NaN; else a `SignalError` of `field`."""
    allowed = f"an array {shape} of numbers or NaN, not all NaN"
    array = as_numbers(field, values, allowed)
    if array.shape != shape or np.isinf(array).any() or np.isnan(array).all():
        raise SignalError(field, array.tolist(), allowed)
    return array


def check_values(values: ArrayLike) -> NDArray[np.float64]:
    """1 to `MOST_VALUES` numbers, none infinite and not all NaN; else a `SignalError`."""
    allowed = f"1 to {MOST_VALUES} numbers or NaN, not all NaN"
    array = as_numbers("values", values, allowed)
    if array.ndim != 1 or not 1 <= len(array) <= MOST_VALUES:
        raise SignalError("values", f"an array {array.shape}", allowed)
    return check_numbers("values", array, array.shape)


def check_covariance(field: str, values: ArrayLike, count: int) -> NDArray[np.float64]:
    """A symmetric and positive definite covariance (count, count); else a `SignalError`."""
    array = check_signal(field, values, (count, count))
    variances = np.abs(np.diag(array))
    rounding = 1e-6 * np.sqrt(np.outer(variances, variances))
    is_symmetric = (np.abs(array - array.T) <= rounding).all()
    if not is_symmetric or (np.linalg.eigvalsh(array) <= 0).any():
        allowed = f"a covariance {(count, count)}: symmetric and positive definite"
        raise SignalError(field, array.tolist(), allowed)
    return array


def check_result(field: str, found: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """A copy of what a function of the user's returned, which may reuse its array.

    If it has another shape or is no numbers, a `SignalError` names `field`.
    """
    array = as_numbers(field, found, f"an array {shape}")
    if array.shape != shape:
        raise SignalError(field, f"an array {array.shape}", f"an array {shape}")
    return array.copy()


def as_floats(values: ArrayLike) -> NDArray[np.float64]:
    """Numbers as an array; those that are masked are NaN."""
    if isinstance(values, np.ma.MaskedArray):
        values = np.ma.filled(values.astype(np.float64), np.nan)
    return np.asarray(values, dtype=np.float64)


def as_numbers(field: str, values: ArrayLike, allowed: str) -> NDArray[np.float64]:
    """`as_floats`, with a `SignalError` that names `field`, and what is `allowed`."""
    try:
        return as_floats(values)
    except (TypeError, ValueError, OverflowError):
        raise SignalError(field, values, allowed) from None
