"""Pixel formats: shapes of a camera's images as arrays.

| format | shape | bytes |
|---|---|---|
| bgr, rgb | (h, w, 3) | per pixel |
| bgra | (h, w, 4) | per pixel; the last is unused |
| yuyv, uyvy | (h, w, 2) | per two pixels Y U Y V, or U Y V Y |
| nv12 | (3 h / 2, w) | h rows of Y, then a line U V U V ... for every two rows |
| i420 | (3 h / 2, w) | h rows of Y, then those of U, then of V, half as long, two per line |

The shapes are those of OpenCV's `cvtColor` codes: a frame grabbed with ``CAP_PROP_CONVERT_RGB`` off
needs no conversion. Y, U, V are ITU-R BT.601 with limited range.
"""

import numpy as np
from numpy.typing import NDArray

from tautscope.config import CameraConfig, PixelFormat
from tautscope.errors import FrameError

_CHANNELS = {"bgr": 3, "rgb": 3, "bgra": 4, "yuyv": 2, "uyvy": 2}  # the others are planar
_BYTE = np.dtype(np.uint8)


class FrameLayout:
    """Memory layout of the images of a camera."""

    def __init__(self, camera: CameraConfig) -> None:
        self.pixel_format = camera.pixel_format
        self.shape: tuple[int, ...] = (camera.height * 3 // 2, camera.width)
        self._in_line: tuple[int, ...] = (1,)
        if channels := _CHANNELS.get(self.pixel_format):
            self.shape, self._in_line = (camera.height, camera.width, channels), (channels, 1)

    def checked(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The image itself, if it can be read in place.

        Raises:
            FrameError: It is not a uint8 array of this shape, or the bytes of a line are not
                contiguous from left to right, or the lines not from top to bottom.
        """
        wanted = f"uint8 array {self.shape}, {self.pixel_format}"
        if not isinstance(image, np.ndarray) or image.dtype != _BYTE or image.shape != self.shape:
            raise FrameError("image", _described(image), wanted)
        strides = image.strides
        # A side of one pixel may have any stride.
        is_contiguous = strides[1:] == self._in_line or image[0].flags.c_contiguous
        if not is_contiguous or strides[0] < 0:
            raise FrameError(
                "image",
                f"{_described(image)} with strides {strides}",
                f"{wanted}, contiguous in each line and top to bottom; np.ascontiguousarray copies",
            )
        return image


def brightness(image: NDArray[np.uint8], pixel_format: PixelFormat) -> NDArray[np.uint8]:
    """The bytes of an image that contain brightness, (h, w, 3) B, G, R or (h, w, 1) Y; a view."""
    if image.ndim == 2:
        return image[: len(image) * 2 // 3, :, None]
    return image[..., {"yuyv": slice(1), "uyvy": slice(1, 2)}.get(pixel_format, slice(3))]


def black(camera: CameraConfig) -> NDArray[np.uint8]:
    """A black image."""
    image = np.zeros(FrameLayout(camera).shape, np.uint8)
    if white(camera.pixel_format) < 255:
        image[:] = 128
        brightness(image, camera.pixel_format)[:] = 16
    return image


def white(pixel_format: PixelFormat) -> int:
    """The brightness of white."""
    return 255 if pixel_format in ("bgr", "rgb", "bgra") else 235


def _described(image: object) -> str:
    if isinstance(image, np.ndarray):
        return f"{image.dtype} array {image.shape}"
    return type(image).__name__
