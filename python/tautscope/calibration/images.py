"""Images of a camera as BGR, and image files."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.config import PixelFormat
from tautscope.errors import FieldError, MissingPathError

Image = NDArray[np.uint8]
SATURATED = 250
"""Level of grey, or of a channel, from which a pixel is overexposed."""

_TO_BGR = {
    "rgb": cv2.COLOR_RGB2BGR,
    "bgra": cv2.COLOR_BGRA2BGR,
    "yuyv": cv2.COLOR_YUV2BGR_YUY2,
    "uyvy": cv2.COLOR_YUV2BGR_UYVY,
    "nv12": cv2.COLOR_YUV2BGR_NV12,
    "i420": cv2.COLOR_YUV2BGR_I420,
}


def to_bgr(image: Image, pixel_format: PixelFormat) -> Image:
    """An image of a camera as B, G, R, (height, width, 3)."""
    code = _TO_BGR.get(pixel_format)
    return image if code is None else np.asarray(cv2.cvtColor(image, code), np.uint8)


def read_image(file: Path, *, is_grey: bool = False) -> Image:
    """Read an image file: B, G, R or grey.

    Raises:
        MissingPathError: The file does not exist.
        FieldError: OpenCV does not read it.
    """
    if not file.is_file():
        raise MissingPathError("image", str(file), "an image file")
    image = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE if is_grey else cv2.IMREAD_COLOR)
    if image is None:
        raise FieldError("image", str(file), "an image that OpenCV reads: PNG, JPEG, TIFF, ...")
    return np.asarray(image, dtype=np.uint8)
