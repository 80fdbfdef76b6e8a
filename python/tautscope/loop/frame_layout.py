"""Pixel formats: what shape a camera's images have as arrays, and what is refused.

| format | shape | bytes |
|---|---|---|
| bgr, rgb | (h, w, 3) | per pixel |
| bgra | (h, w, 4) | per pixel; the last is not looked at |
| yuyv, uyvy | (h, w, 2) | per two pixels Y U Y V, or U Y V Y |
| nv12 | (3 h / 2, w) | h rows of Y, then for every two rows a line U V U V ... |
| i420 | (3 h / 2, w) | h rows of Y, then those of U, then of V, half as long, two to a line |

The shapes are those of OpenCV's `cvtColor` codes, so that a frame grabbed with
``CAP_PROP_CONVERT_RGB`` off goes in as it is. Y, U, V are ITU-R BT.601 with limited range.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tautscope.config import CameraConfig
from tautscope.errors import ConfigError, FrameError

_CHANNELS = {"bgr": 3, "rgb": 3, "bgra": 4, "yuyv": 2, "uyvy": 2}
_PLANAR = ("nv12", "i420")
_BYTE = np.dtype(np.uint8)


class FrameLayout:
    """What the images of a camera look like in memory.

    Args:
        camera: The camera; its `width`, `height` and `pixel_format` are used.

    Attributes:
        shape: Of the arrays.

    Raises:
        ConfigError: A side is odd where the format has one colour for two pixels.
    """

    def __init__(self, camera: CameraConfig) -> None:
        self.pixel_format = camera.pixel_format
        planar = self.pixel_format in _PLANAR
        if camera.width % 2 and (planar or _CHANNELS[self.pixel_format] == 2):
            raise ConfigError("camera.width", camera.width, f"even, for {self.pixel_format}")
        if camera.height % 2 and planar:
            raise ConfigError("camera.height", camera.height, f"even, for {self.pixel_format}")
        self.shape: tuple[int, ...] = (
            (camera.height * 3 // 2, camera.width)
            if planar
            else (camera.height, camera.width, _CHANNELS[self.pixel_format])
        )
        self._in_line = (1,) if planar else (_CHANNELS[self.pixel_format], 1)

    def checked(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The image, if it can be read where it lies.

        Raises:
            FrameError: It is not a uint8 array of this shape, or the bytes of a line do not lie
                side by side from left to right, or the lines not from top to bottom.
        """
        wanted = f"uint8 array {self.shape}, {self.pixel_format}"
        if not isinstance(image, np.ndarray) or image.dtype != _BYTE or image.shape != self.shape:
            raise FrameError("image", _described(image), wanted)
        strides = image.strides
        # A side of one pixel may have any stride.
        side_by_side = strides[1:] == self._in_line or image[0].flags.c_contiguous
        if not side_by_side or strides[0] < 0:
            raise FrameError(
                "image",
                f"{_described(image)} with strides {strides}",
                f"{wanted}, contiguous in each line and top to bottom; np.ascontiguousarray copies",
            )
        return image


def _described(image: object) -> str:
    if isinstance(image, np.ndarray):
        return f"{image.dtype} array {image.shape}"
    return type(image).__name__
