"""Images of a calibration board: from files, a live camera, or the twin."""

from __future__ import annotations

import sys
import time
from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tautscope.config import CameraConfig, Config
from tautscope.errors import CameraError
from tautscope.hardware.cameras import Camera
from tautscope.hardware.video import open_video_file, read_video

if TYPE_CHECKING:
    from tautscope.calibration.camera.board import Board

Image = NDArray[np.uint8]
_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp", ".webp", ".pgm", ".ppm")
_MOST_TWIN_IMAGES = 60
_PIXELS_PER_MODULE = 10


@dataclass(frozen=True)
class BoardImages:
    """Images in which a board may be.

    Attributes:
        size: Width and height [px].
        images: B, G, R; to be closed.
        is_stream: Whether they are consecutive.
        is_live: Whether they end only when they suffice.
        serial_numbers: That of the camera, if known.
    """

    size: tuple[int, int]
    images: Generator[Image]
    is_stream: bool = False
    is_live: bool = False
    serial_numbers: Mapping[str, str] = field(default_factory=dict)


def file_images(files: Sequence[Path]) -> BoardImages:
    """Images of image files, or of one video.

    Raises:
        MissingPathError: A file does not exist.
        FieldError: A file is no image, or no video.
    """
    from tautscope.calibration.images import read_image  # noqa: PLC0415

    if len(files) == 1 and files[0].suffix.lower() not in _SUFFIXES:
        return _video_images(files[0])
    height, width = read_image(files[0]).shape[:2]
    return BoardImages((width, height), (read_image(file) for file in files))


def live_images(config: Config, seconds: float) -> BoardImages:
    """Images of the camera of a configuration, for at most so many seconds.

    While none arrive it is printed why; after `camera.source.lost_timeout` it is a `CameraError`.
    """
    from tautscope.calibration.images import to_bgr  # noqa: PLC0415
    from tautscope.hardware.serial_numbers import camera_serial_number  # noqa: PLC0415

    def read() -> Generator[Image]:
        with Camera(config.camera) as camera:
            print("Show the board, and hold it still in each pose.", file=sys.stderr, flush=True)
            end, trouble = time.monotonic() + seconds, ""
            while time.monotonic() < end:
                if (capture := camera.newest()) is not None:
                    trouble = ""
                    yield to_bgr(capture.frame.image, config.camera.pixel_format)
                    continue
                state, lost = camera.state, config.camera.source.lost_timeout
                if state.age > lost:
                    allowed = f"images; none came for camera.source.lost_timeout, {lost:g} s"
                    raise CameraError("camera.source", state.trouble, allowed)
                if state.trouble and not trouble:
                    trouble = state.trouble
                    print(f"camera: {trouble}", file=sys.stderr, flush=True)
                time.sleep(0.002)

    size = config.camera.width, config.camera.height
    return BoardImages(size, read(), True, True, camera_serial_number(config.camera))


def twin_images(config: Config, board: Board) -> BoardImages:
    """Images of a simulated board."""
    from tautscope.calibration.camera.board import MODULES  # noqa: PLC0415
    from tautscope.twin.board import BoardCamera, random_poses  # noqa: PLC0415

    texture = board.texture(_PIXELS_PER_MODULE)
    extent = board.columns * board.square, board.rows * board.square
    camera = BoardCamera(config, texture, board.square / (MODULES * _PIXELS_PER_MODULE))
    poses = random_poses(config.camera, extent, _MOST_TWIN_IMAGES, config.twin.seed)
    images = (camera.draw(*pose, sequence) for sequence, pose in enumerate(poses))
    return BoardImages((config.camera.width, config.camera.height), images, is_live=True)


def _video_images(file: Path) -> BoardImages:
    with open_video_file(str(file)) as container:
        stream = container.streams.video[0]
        size = stream.width, stream.height
    frames = read_video(str(file), CameraConfig(width=size[0], height=size[1]))
    return BoardImages(size, (frame.image for frame in frames), is_stream=True)
