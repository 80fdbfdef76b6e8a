"""Images for people: conversion of a camera's pixel formats, JPEG, and stills as PNG."""

from __future__ import annotations

import threading
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
_TO_BGR = {
    "rgb": cv2.COLOR_RGB2BGR,
    "bgra": cv2.COLOR_BGRA2BGR,
    "yuyv": cv2.COLOR_YUV2BGR_YUY2,
    "uyvy": cv2.COLOR_YUV2BGR_UYVY,
    "nv12": cv2.COLOR_YUV2BGR_NV12,
    "i420": cv2.COLOR_YUV2BGR_I420,
}
JPEG_QUALITY = 80


def to_bgr(image: Image, pixel_format: str) -> Image:
    """An image of any pixel format as BGR."""
    if pixel_format == "bgr":
        return image
    return np.asarray(cv2.cvtColor(image, _TO_BGR[pixel_format]), np.uint8)


def encode_jpeg(image: Image, pixel_format: str) -> bytes:
    """An image as JPEG, for the page."""
    options = (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY)
    return cv2.imencode(".jpg", to_bgr(image, pixel_format), options)[1].tobytes()


def write_still(path: Path, image: Image, pixel_format: str) -> None:
    """Write an image as PNG, in the background."""

    def write() -> None:
        cv2.imwrite(str(path), to_bgr(image, pixel_format))

    threading.Thread(target=write, name="still").start()
