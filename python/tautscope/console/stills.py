"""Images for people: JPEG for the page, and stills as PNG."""

from __future__ import annotations

import threading
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.images import to_bgr
from tautscope.config import PixelFormat

Image = NDArray[np.uint8]
JPEG_QUALITY = 80


def encode_jpeg(image: Image, pixel_format: PixelFormat) -> bytes:
    """An image as JPEG, for the page."""
    options = (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY)
    return cv2.imencode(".jpg", to_bgr(image, pixel_format), options)[1].tobytes()


def write_still(path: Path, image: Image, pixel_format: PixelFormat) -> None:
    """Write an image as PNG, in the background."""

    def write() -> None:
        cv2.imwrite(str(path), to_bgr(image, pixel_format))

    threading.Thread(target=write, name="still").start()
