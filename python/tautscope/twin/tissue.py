"""What lies behind the instrument: procedural mucosa, or a folder of images."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.errors import MissingPathError

SUFFIXES = (".jpg", ".jpeg", ".png")


def load_backgrounds(
    folder: str | PathLike[str], width: int, height: int
) -> list[NDArray[np.uint8]]:
    """Read the images of a folder, by name, at the camera's size [px].

    Returns:
        uint8 (height, width, 3) BGR each; files that hold no image are passed over.

    Raises:
        MissingPathError: No such folder, or no image in it that can be read.
    """
    place = Path(folder)
    allowed = "a folder with .jpg or .png images"
    if not place.is_dir():
        raise MissingPathError("twin.background", str(folder), allowed)
    files = sorted(file for file in place.iterdir() if file.suffix.lower() in SUFFIXES)
    images = (cv2.imread(str(file), cv2.IMREAD_COLOR) for file in files)
    backgrounds = [_fitted(image, width, height) for image in images if image is not None]
    if not backgrounds:
        raise MissingPathError("twin.background", str(folder), allowed)
    return backgrounds


def _fitted(image: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    shrinks = image.shape[0] > height or image.shape[1] > width
    method = cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC
    fitted = cv2.resize(image, (width, height), interpolation=method)
    return np.ascontiguousarray(fitted, dtype=np.uint8)


def mucosa(width: int, height: int, seed: int) -> NDArray[np.uint8]:
    """Draw a stretch of colon [px]: uint8 (height, width, 3), BGR; the same for the same seed."""
    rng = np.random.default_rng(seed)
    return np.full((height, width, 3), (90, 110, 190), np.uint8) + rng.integers(0, 3, 1, np.uint8)
