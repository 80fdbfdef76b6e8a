"""Labelled images: which pixels are on the bands, and which are not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Mask = NDArray[np.uint8]

BACKGROUND, BAND_A, BAND_B, IGNORED = 0, 1, 2, 255
"""Values of a label image."""
SATURATED = 250
"""A pixel with a channel from here on is ignored: overexposed."""
_RIM = 4
"""Width of what is ignored around a band: its edge is blurred [px]."""


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
        return np.asarray(self.image[self.labels == label], np.uint8)


def labelled(image: Image, bands: Sequence[Mask]) -> LabelledImage:
    """Label an image by the masks of its bands, which lose their blurred edges.

    Args:
        image: B, G, R.
        bands: One mask per band, not 0 on it.
    """
    labels = np.full(image.shape[:2], BACKGROUND, np.uint8)
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _RIM + 1,) * 2)
    every = np.zeros(image.shape[:2], np.uint8)
    for band in bands:
        every |= (band > 0).astype(np.uint8)
    labels[cv2.dilate(every, kernel) > 0] = IGNORED
    for label, band in zip((BAND_A, BAND_B), bands, strict=False):
        labels[cv2.erode((band > 0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0] = label
    labels[(image >= SATURATED).any(axis=2)] = IGNORED
    return LabelledImage(image, labels)
