"""Calibration of the marker colour: Fisher's linear discriminant of labelled pixels, Eq. (12)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.errors import FieldError


def fit_discriminant(
    marker_pixels: ArrayLike, background_pixels: ArrayLike
) -> tuple[tuple[float, float, float], float]:
    """Fisher's discriminant with equal priors: a pixel x is marker if w . x > threshold.

    With mean colour mu and covariance S of marker (m) and background (b) pixels::

        w = (S_m + S_b)^-1 (mu_m - mu_b),    threshold = w . (mu_m + mu_b) / 2

    Both are divided by the largest magnitude of the weights, so that the threshold is in grey
    levels, and are the values of `vision.weights` and `vision.threshold`.

    Wrong when the classes are not normally distributed with equal covariance: label pixels of all
    brightnesses that will occur, without saturated ones.

    Args:
        marker_pixels: (n, 3) B, G, R of pixels on the bands.
        background_pixels: (m, 3) B, G, R of all other pixels.

    Returns:
        The weights of B, G, R and the threshold.

    Raises:
        FieldError: Pixels are not a (n, 3) array of finite numbers with n >= 2, all lie on one
            plane of the colour space, or both classes have the same mean colour.
    """
    marker = _checked("marker_pixels", marker_pixels)
    background = _checked("background_pixels", background_pixels)
    means = marker.mean(axis=0), background.mean(axis=0)
    scatter = np.cov(marker.T, ddof=0) + np.cov(background.T, ddof=0)
    if np.linalg.matrix_rank(scatter) < 3:
        raise FieldError(
            "marker_pixels",
            f"{len(marker)} pixels, and {len(background)} of background, on a plane of the colours",
            "pixels that differ in all three channels",
        )
    weights = np.linalg.solve(scatter, means[0] - means[1])
    largest = float(np.abs(weights).max())
    if largest == 0:
        raise FieldError("marker_pixels", means[0].tolist(), "a mean unlike the background's")
    blue, green, red = (weights / largest).tolist()
    return (blue, green, red), float(weights @ (means[0] + means[1]) / 2 / largest)


def _checked(field: str, pixels: ArrayLike) -> NDArray[np.float64]:
    try:
        array = np.asarray(pixels, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim != 2 or array.shape[1:] != (3,) or len(array) < 2:
        raise FieldError(field, f"array {array.shape}", "B, G, R of two pixels or more, (n, 3)")
    finite = np.isfinite(array).all(axis=1)
    if not finite.all():
        raise FieldError(field, array[~finite][0].tolist(), "finite numbers")
    return array
