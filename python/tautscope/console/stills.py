"""Images for people: JPEG for the page, and stills as PNG."""

from __future__ import annotations

import math
import threading
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.images import to_bgr
from tautscope.config import PixelFormat

Image = NDArray[np.uint8]
JPEG_QUALITY = 80


def encode_jpeg(image: Image, pixel_format: PixelFormat, width: float = math.inf) -> bytes:
    """An image as JPEG, for the page; halved while that leaves at least `width` pixels across."""
    pixels: NDArray[Any] = to_bgr(image, pixel_format)
    while pixels.shape[1] // 2 >= max(width, 1):
        size = pixels.shape[1] // 2, pixels.shape[0] // 2
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    options = (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY)
    return cv2.imencode(".jpg", pixels, options)[1].tobytes()


def write_still(path: Path, image: Image, pixel_format: PixelFormat) -> None:
    """Write an image as PNG, in the background."""

    def write() -> None:
        cv2.imwrite(str(path), to_bgr(image, pixel_format))

    threading.Thread(target=write, name="still").start()
