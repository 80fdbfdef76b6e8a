"""Bands in an image: regions of one colour, and labels of pixels from regions, clicks or masks."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.images import SATURATED, Image
from tautscope.errors import CalibrationError, FieldError
from tautscope.loop.kinematics import Floats

Mask = NDArray[np.uint8]

BACKGROUND, BAND_A, BAND_B, IGNORED = 0, 1, 2, 255
"""Values of a label image."""
_RIM = 4
"""Width of what is ignored around a band: its edge is blurred [px]."""
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
_TOLERANCES = range(4, 61, 4)
"""Differences of a channel to the clicked pixel that are tried [grey levels]."""
_LEAK = 1.6
"""A region that grows by more from one tolerance to the next has run into its surroundings."""
_LARGEST_SHARE = 0.1
"""Largest share of the image in a band."""
_LEAST_CLICKED = 30
"""[px]."""


@dataclass(frozen=True)
class LabelledImage:
    """An image and the label of each pixel.

    Attributes:
        image: B, G, R (height, width, 3).
        labels: (height, width): `BACKGROUND`, `BAND_A`, `BAND_B` or `IGNORED`.
    """

    image: Image
    labels: Mask

    def pixels(self, label: int) -> Image:
        """The pixels (n, 3) with a label."""
        has_label = (self.labels == label).ravel()
        return np.asarray(self.image.reshape(-1, 3).compress(has_label, axis=0), np.uint8)


def labelled(image: Image, bands: Sequence[Mask]) -> LabelledImage:
    """Label an image by the masks of its bands, which lose their blurred edges.

    Args:
        image: B, G, R.
        bands: One mask per band, not 0 on it.
    """
    labels = np.full(image.shape[:2], BACKGROUND, np.uint8)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _RIM + 1,) * 2)
    masks = [(band > 0).astype(np.uint8) for band in bands]
    labels[cv2.dilate(np.maximum.reduce(masks), kernel) > 0] = IGNORED
    for label, band in zip((BAND_A, BAND_B), masks, strict=False):
        labels[cv2.erode(band, np.ones((3, 3), np.uint8)) > 0] = label
    labels[(image >= SATURATED).any(axis=2)] = IGNORED
    return LabelledImage(image, labels)


def from_mask(image: Image, mask: Image) -> LabelledImage:
    """Label an image by a mask: white on the bands, black elsewhere, grey where ignored."""
    labels = np.full(mask.shape, IGNORED, np.uint8)
    labels[mask > 250], labels[mask < 5] = BAND_A, BACKGROUND
    return LabelledImage(image, labels)


def two_bands(image: Image, weights: Sequence[float], threshold: float) -> tuple[Mask, Mask] | None:
    """The two compact regions of a colour, if it has no others of their size."""
    values = cv2.transform(image.astype(np.float32), np.array([weights], np.float32))
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
    border = np.concatenate([names[0], names[-1], names[:, 0], names[:, -1]])
    is_cut = np.isin([first + 1, second + 1], border).any()
    if is_cut or any(_solidity(band) < _LEAST_SOLIDITY for band in bands):
        return None
    distance = np.linalg.norm(np.subtract(*(centroid(band) for band in bands)))
    if distance < _LEAST_DISTANCE * np.sqrt((larger + smaller) / 2):
        return None
    return bands[0], bands[1]


def _solidity(mask: Mask) -> float:
    points = cv2.findNonZero(mask)
    hull = cv2.convexHull(points)
    # The area of a hull is that between pixel centres.
    around = cv2.contourArea(hull) + cv2.arcLength(hull, True) / 2 + 1
    return float(len(points) / around)


def centroid(mask: Mask) -> Floats:
    """Mean u, v of the pixels of a region [px]."""
    return np.asarray(cv2.findNonZero(mask).reshape(-1, 2).mean(axis=0), np.float64)


def label_clicks(image: Image, clicks: Sequence[tuple[int, int]]) -> LabelledImage:
    """Label an image by a pixel on each band.

    The region around each pixel grows with the tolerance of its colour until it runs into its
    surroundings: the largest region before the first jump of its area.

    Raises:
        FieldError: There are not two clicks u, v [px], or one is outside the image.
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
    last = np.zeros(image.shape[:2], np.uint8)
    for tolerance in _TOLERANCES:
        mask = np.zeros((image.shape[0] + 2, image.shape[1] + 2), np.uint8)
        flags = 4 | cv2.FLOODFILL_FIXED_RANGE | cv2.FLOODFILL_MASK_ONLY | (1 << 8)
        limits = (tolerance,) * 3
        cv2.floodFill(image.copy(), mask, click, (0, 0, 0), limits, limits, flags)
        region = mask[1:-1, 1:-1]
        area, before = int(region.sum()), int(last.sum())
        has_leaked = before >= _LEAST_CLICKED and area > _LEAK * before
        if has_leaked or area > _LARGEST_SHARE * last.size:
            break
        last = region
    if last.sum() < _LEAST_CLICKED:
        colour = image[click[1], click[0]].tolist()
        raise CalibrationError(
            f"The colour {colour} at the click {click} cannot be told from its surroundings",
            "Click into the middle of a band, in a sharp image; or use masks",
        )
    return last
