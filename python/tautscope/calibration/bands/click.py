"""Bands grown from a clicked pixel each."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from tautscope.calibration.bands.labels import Image, LabelledImage, Mask, labelled
from tautscope.errors import CalibrationError, FieldError

_TOLERANCES = range(4, 61, 4)
"""Differences of a channel to the clicked pixel that are tried [grey levels]."""
_LEAK = 1.6
"""A region that grows by more from one tolerance to the next has run into its surroundings."""
_LARGEST_SHARE = 0.1
"""Largest share of the image in a band."""
_LEAST_AREA = 30
"""[px]."""


def label_clicks(image: Image, clicks: Sequence[tuple[int, int]]) -> LabelledImage:
    """Label an image by a pixel on each band.

    The region around each pixel grows with the tolerance of its colour until it runs into its
    surroundings: the largest region before the first jump of its area.

    Args:
        image: B, G, R.
        clicks: u, v of a pixel on each of the two bands [px].

    Raises:
        FieldError: There are not two clicks, or one is outside the image.
        CalibrationError: A region cannot be told from its surroundings, or is that of the other.
    """
    height, width = image.shape[:2]
    if len(clicks) != 2:
        raise FieldError("clicks", len(clicks), "two: a pixel on each band")
    for u, v in clicks:
        if not (0 <= u < width and 0 <= v < height):
            raise FieldError("click", (u, v), f"a pixel of the image, {width} x {height}")
    smooth = np.asarray(cv2.medianBlur(image, 5), np.uint8)
    bands = [_grown(smooth, click) for click in clicks]
    if (bands[0] & bands[1]).any():
        raise CalibrationError(
            f"The clicks {clicks[0]} and {clicks[1]} are on one region", "Click on each band"
        )
    return labelled(image, bands)


def _grown(image: Image, click: tuple[int, int]) -> Mask:
    last: Mask | None = None
    largest = _LARGEST_SHARE * image.shape[0] * image.shape[1]
    for tolerance in _TOLERANCES:
        mask = np.zeros((image.shape[0] + 2, image.shape[1] + 2), np.uint8)
        flags = 4 | cv2.FLOODFILL_FIXED_RANGE | cv2.FLOODFILL_MASK_ONLY | (1 << 8)
        limits = (tolerance,) * 3
        cv2.floodFill(image.copy(), mask, click, (0, 0, 0), limits, limits, flags)
        region = mask[1:-1, 1:-1]
        area = int(region.sum())
        before = 0 if last is None else int(last.sum())
        if area > largest or (before >= _LEAST_AREA and area > _LEAK * before):
            break
        last = region
    if last is None or last.sum() < _LEAST_AREA:
        colour = image[click[1], click[0]].tolist()
        raise CalibrationError(
            f"The colour {colour} at the click {click} cannot be told from its surroundings",
            "Click into the middle of a band, in a sharp image; or use masks",
        )
    return np.asarray(last, np.uint8)
