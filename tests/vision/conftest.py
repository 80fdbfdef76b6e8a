"""Real colon frames at the size of the camera."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray


@pytest.fixture(scope="session")
def colon_frames(colon_folder: Path) -> dict[str, tuple[NDArray[np.uint8], NDArray[np.bool_]]]:
    """By name: the image, uint8 (576, 720, 3), B, G, R, and which of its pixels are tissue.

    Not tissue is the corner with the scope guide's green inset, in the frames that have it.
    """
    files = sorted(colon_folder.glob("*.jpg"))
    images = [cv2.imread(str(file)) for file in files]
    resized = [cv2.resize(image, (720, 576), interpolation=cv2.INTER_AREA) for image in images]
    return {file.stem: (image, _tissue(image)) for file, image in zip(files, resized, strict=True)}


def _tissue(image: NDArray[np.uint8]) -> NDArray[np.bool_]:
    corner = slice(380, 576), slice(0, 240)
    blue, green, red = np.moveaxis(image[corner].astype(int), 2, 0)
    tissue = np.ones(image.shape[:2], dtype=bool)
    tissue[corner] = (green - np.maximum(blue, red) > 20).mean() < 0.5
    return tissue
