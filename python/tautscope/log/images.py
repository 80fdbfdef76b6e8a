"""Camera images as the bytes of a ``sensor_msgs/CompressedImage``, and back.

PNG gives every byte back. BGR, RGB and BGRA look right in a viewer; of the YUV formats, whose
bytes are kept as a grey picture, only the brightness can be made out.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.config import CameraConfig, RecordingConfig
from tautscope.errors import RecordError
from tautscope.loop.frame_layout import FrameLayout

Image = NDArray[np.uint8]

# Differences of neighbours, stored as they are: the log's chunks are compressed, and quicker.
_PNG = (
    *(cv2.IMWRITE_PNG_COMPRESSION, 0),
    *(cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_SUB),
)
# Colour at half the resolution, JPEG's habit, would cost most of what the vision sees.
_JPEG = (cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444)


class ImageCodec:
    """Images of one camera to bytes and back.

    Args:
        camera: Its size and pixel format.
        recording: Its `image_format` and `jpeg_quality`.

    Attributes:
        format: What ``CompressedImage.format`` says, as ROS 2's image_transport writes it.
    """

    def __init__(self, camera: CameraConfig, recording: RecordingConfig) -> None:
        self._shape = FrameLayout(camera).shape
        self._is_rgb = camera.pixel_format == "rgb"
        self._is_colour = camera.pixel_format in ("bgr", "rgb", "bgra")
        name = {"bgra": "bgra8"}.get(camera.pixel_format, "bgr8") if self._is_colour else "mono8"
        self.format = f"{name}; {recording.image_format} compressed {name}"
        lossy = recording.image_format == "jpeg"
        self._suffix = ".jpg" if lossy else ".png"
        self._options = (
            (cv2.IMWRITE_JPEG_QUALITY, recording.jpeg_quality, *_JPEG) if lossy else _PNG
        )

    def encode(self, image: Image) -> bytes:
        """The bytes of an image of the configured layout."""
        picture = image if self._is_colour else image.reshape(image.shape[0], -1)
        if self._is_rgb:
            picture = picture[..., ::-1]
        _, data = cv2.imencode(self._suffix, np.ascontiguousarray(picture), self._options)
        return data.tobytes()

    def decode(self, data: bytes) -> Image:
        """The image of some bytes, PNG or JPEG.

        Raises:
            RecordError: They are no picture of the configured layout.
        """
        kind = cv2.IMREAD_UNCHANGED if self._is_colour else cv2.IMREAD_GRAYSCALE
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), kind) if data else None
        found = None if picture is None else np.asarray(picture, dtype=np.uint8)
        if found is None or found.size != np.prod(self._shape):
            came = "no picture" if found is None else f"a picture {found.shape}"
            raise RecordError("image", came, f"pixels of an array {self._shape}")
        found = found.reshape(self._shape)
        return np.ascontiguousarray(found[..., ::-1]) if self._is_rgb else found
