"""The markers' colour: Fisher's linear discriminant from labelled pixels, Eq. (12)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.errors import FieldError


@dataclass(frozen=True, slots=True)
class ColorDiscriminant:
    """Which colours are marker: those with w . x > threshold, x = (B, G, R) [grey levels].

    Attributes:
        weights: Of B, G, R; `vision.weights`.
        threshold: `vision.threshold` [grey levels].
        training_margin: `margin` of the marker pixels it was fitted to.
    """

    weights: tuple[float, float, float]
    threshold: float
    training_margin: float

    @classmethod
    def fit(cls, marker: ArrayLike, background: ArrayLike) -> ColorDiscriminant:
        """Fisher's discriminant with equal priors from labelled pixels, see `fit_discriminant`.

        Args:
            marker: (n, 3) B, G, R of pixels on the bands.
            background: (m, 3) B, G, R of pixels of everything else.

        Raises:
            FieldError: As `fit_discriminant`.
        """
        weights, threshold = fit_discriminant(marker, background)
        unfitted = cls(weights, threshold, 0.0)
        return cls(weights, threshold, unfitted.margin(marker))

    def is_marker(self, pixels: ArrayLike) -> NDArray[np.bool_]:
        """Which of pixels (n, 3) are marker (n,)."""
        values: NDArray[np.float64] = _checked("pixels", pixels) @ np.array(self.weights)
        return values > self.threshold

    def margin(self, marker: ArrayLike) -> float:
        """How far pixels (n, 3) are on the markers' side: median of (w . x - threshold) / |x|.

        The division by the pixel's brightness makes it independent of the exposure, but for the
        threshold. 0 is on the boundary.
        """
        pixels = _checked("marker", marker)
        brightness = np.maximum(np.linalg.norm(pixels, axis=1), 1.0)
        return float(np.median((pixels @ np.array(self.weights) - self.threshold) / brightness))

    def has_drifted(self, marker: ArrayLike) -> bool:
        """Whether a scene's marker pixels have lost half of the training's margin: fit anew.

        Args:
            marker: (n, 3) pixels within the bands of a trusted detection.
        """
        return self.margin(marker) < 0.5 * self.training_margin


def fit_discriminant(
    marker_pixels: ArrayLike, background_pixels: ArrayLike
) -> tuple[tuple[float, float, float], float]:
    """The weights and the threshold that tell marker from background: marker if w . x > threshold.

    Fisher's discriminant with equal priors: however few of the labelled pixels are marker, both
    kinds count the same::

        w = (S_m + S_b)^-1 (mu_m - mu_b),    threshold = w . (mu_m + mu_b) / 2

    with mu and S the mean colour and the covariance of each kind. Both are divided by the largest
    magnitude among the weights, so that the threshold reads as grey levels. They are the values of
    `vision.weights` and `vision.threshold`.

    It is the best linear rule if both kinds are normally distributed with the same covariance.
    Shadow and highlight stretch both along the line to black or white: label pixels of the
    brightnesses that will occur, and no saturated ones.

    Args:
        marker_pixels: (n, 3) B, G, R of pixels on the bands.
        background_pixels: (m, 3) B, G, R of pixels of everything else that may be in the picture.

    Returns:
        The weights of B, G, R and the threshold.

    Raises:
        FieldError: Pixels are not a (n, 3) array of finite numbers with n >= 2, they all lie on one
            plane of the colour space, or both kinds have the same mean colour.
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
