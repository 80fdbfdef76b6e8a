"""Two compact regions of one colour in an image."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.bands.labels import Image, Mask

Floats = NDArray[np.float64]

_MOST_ALIKE = 4.0
"""Largest ratio of the areas of the bands."""
_LEAST_SOLIDITY = 0.6
"""Least area of a band relative to its convex hull; bands are arcs in the image."""
LEAST_AREA = 40
"""Least area of a band [px]."""
_LEAST_DISTANCE = 1.2
"""Least distance of the bands relative to the root of their mean area."""
_REMAINDER = 0.35
"""Largest area of all other regions relative to the bands."""


def two_bands(image: Image, weights: Sequence[float], threshold: float) -> tuple[Mask, Mask] | None:
    """The two compact regions of a colour, if it has no others of their size."""
    kernel = np.array([weights], np.float32)
    values = cv2.transform(image.astype(np.float32), kernel)
    values = cv2.GaussianBlur(values, (0, 0), 1.0)
    mask = (values > threshold).astype(np.uint8)
    mask = np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)), np.uint8)
    count, names, stats, _ = cv2.connectedComponentsWithStats(mask)
    if count < 3:
        return None
    areas = stats[1:, cv2.CC_STAT_AREA]
    first, second = np.argsort(areas)[::-1][:2]
    larger, smaller = int(areas[first]), int(areas[second])
    if smaller < LEAST_AREA or larger > _MOST_ALIKE * smaller:
        return None
    if areas.sum() - larger - smaller > _REMAINDER * (larger + smaller):
        return None
    bands = [(names == name + 1).astype(np.uint8) for name in (first, second)]
    if any(_touches_border(band) or _solidity(band) < _LEAST_SOLIDITY for band in bands):
        return None
    distance = np.linalg.norm(np.subtract(*(centroid(band) for band in bands)))
    if distance < _LEAST_DISTANCE * np.sqrt((larger + smaller) / 2):
        return None
    return bands[0], bands[1]


def _touches_border(mask: Mask) -> bool:
    return bool(mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any())


def _solidity(mask: Mask) -> float:
    points = cv2.findNonZero(mask)
    hull = cv2.convexHull(points)
    # The area of a hull is that between pixel centres.
    around = cv2.contourArea(hull) + cv2.arcLength(hull, True) / 2 + 1
    return float(len(points) / around)


def centroid(mask: Mask) -> Floats:
    """Mean u, v of the pixels of a region [px]."""
    return np.asarray(cv2.findNonZero(mask).reshape(-1, 2).mean(axis=0), np.float64)
