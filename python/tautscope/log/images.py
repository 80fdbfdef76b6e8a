"""Encoding of camera images for ``sensor_msgs/CompressedImage``, and decoding.

PNG is lossless. Viewers show BGR, RGB and BGRA correctly; images in YUV formats are stored as grey
images of their bytes.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.config import CameraConfig, RecordingConfig
from tautscope.errors import RecordError
from tautscope.loop.frame_layout import FrameLayout

Image = NDArray[np.uint8]

# Filtered and not compressed: the log's chunks are compressed, which is faster. OpenCV before 4.12
# cannot choose the filter, and writes larger logs.
_PNG: tuple[int, ...] = (cv2.IMWRITE_PNG_COMPRESSION, 0)
if hasattr(cv2, "IMWRITE_PNG_FILTER"):
    _PNG += (cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_SUB)
# JPEG's default subsampling of colour would remove most of the markers' contrast.
_JPEG = (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)


class ImageCodec:
    """Encodes and decodes the images of one camera.

    Args:
        camera: Size and pixel format are used.
        recording: `image_format` and `jpeg_quality` are used.

    Attributes:
        format: Value of ``CompressedImage.format``, as in ROS 2's image_transport.
    """

    def __init__(self, camera: CameraConfig, recording: RecordingConfig) -> None:
        self._shape = FrameLayout(camera).shape
        self._is_rgb = camera.pixel_format == "rgb"
        self._is_colour = camera.pixel_format in ("bgr", "rgb", "bgra")
        name = {"bgra": "bgra8"}.get(camera.pixel_format, "bgr8") if self._is_colour else "mono8"
        self.format = f"{name}; {recording.image_format} compressed {name}"
        is_lossy = recording.image_format == "jpeg"
        self._suffix = ".jpg" if is_lossy else ".png"
        self._options = (
            (cv2.IMWRITE_JPEG_QUALITY, recording.jpeg_quality, *_JPEG) if is_lossy else _PNG
        )

    def encode(self, image: Image) -> bytes:
        """Encode an image of the configured layout."""
        pixels = image if self._is_colour else image.reshape(image.shape[0], -1)
        if self._is_rgb:
            pixels = pixels[..., ::-1]
        _, data = cv2.imencode(self._suffix, np.ascontiguousarray(pixels), self._options)
        return data.tobytes()

    def decode(self, data: bytes) -> Image:
        """Decode a PNG or JPEG image.

        Raises:
            RecordError: The bytes are not an image of the configured layout.
        """
        kind = cv2.IMREAD_UNCHANGED if self._is_colour else cv2.IMREAD_GRAYSCALE
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), kind) if data else None
        if pixels is not None and self._shape[2:] == (4,) and pixels.shape[2:] == (3,):
            pixels = cv2.cvtColor(pixels, cv2.COLOR_BGR2BGRA)  # JPEG has no fourth channel
        image = None if pixels is None else np.asarray(pixels, dtype=np.uint8)
        if image is None or image.size != np.prod(self._shape):
            came = "no image" if image is None else f"an image {image.shape}"
            raise RecordError("image", came, f"pixels of an array {self._shape}")
        image = image.reshape(self._shape)
        return np.ascontiguousarray(image[..., ::-1]) if self._is_rgb else image
