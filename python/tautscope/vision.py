"""Image to markers: Eq. (12) and Fig. 5.

Pixel coordinates are OpenCV's: u to the right, v down, the centre of the first pixel is (0, 0).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope import _core
from tautscope.config import CameraConfig, Config
from tautscope.errors import FieldError
from tautscope.pixels import FrameLayout


@dataclass(frozen=True, slots=True)
class Region:
    """Pixels of the markers' colour that touch each other along edges or at corners.

    Attributes:
        centroid: Mean of the pixels' centres, u, v [px].
        area: Number of pixels.
        box: Bounding box: left, top, width, height [px].
    """

    centroid: tuple[float, float]
    area: int
    box: tuple[int, int, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """What a frame shows.

    Attributes:
        features: (4,) [px] the measured features: centroids of the bands, u_A, v_A, u_B, v_B, A the
            proximal band. NaN where `valid` is false.
        reason: Why there are no features; empty if there are.
        regions: What has the markers' colour, the largest first, at most 16.
    """

    features: NDArray[np.float64]
    reason: str
    regions: tuple[Region, ...]

    @property
    def valid(self) -> bool:
        """Whether both markers were found."""
        return not self.reason


class MarkerDetector:
    """Finds the two bands of the instrument in camera images, Eq. (12) and Fig. 5.

    Each pixel is projected, w_b B + w_g G + w_r R, the projection low-passed and thresholded, the
    pixels above the threshold joined into 8-connected regions. `config.vision` has the numbers.

    - With predicted features, A and B are the two regions that lie nearest to them, within
      ``vision.gate``, and that have comparable areas; crates/vision/src/markers.rs has the cost.
    - Without, they are the two largest regions, as in the article, and A, the proximal band, is the
      one nearer to where the instrument enters the picture.

    The centroid of a region is not exactly the image of the band's centre: the camera sees the near
    side of a cylinder, and a highlight takes pixels away. Without a prediction anything green that
    is larger than a band is taken for one.

    The arithmetic is in fixed point. With the largest sum of weights of one sign s, a low-passed
    value is within (1.25 + smoothing) * 255 * s / 8190 of the exact one: 0.07 grey levels by
    default.

    One detector may be shared between threads; calls take turns. Frames leave nothing behind in it.

    Args:
        config: The configuration; `camera` and `vision` are used.

    Raises:
        ConfigError: All weights of the discriminant are zero, or too small or large to be meant.
    """

    def __init__(self, config: Config) -> None:
        vision = config.vision
        self._layout = FrameLayout(config.camera)
        self._core = _core.MarkerDetector(
            pixel_format=config.camera.pixel_format,
            weights=vision.weights,
            threshold=vision.threshold,
            smoothing=vision.smoothing,
            minimum_area=vision.minimum_area,
            gate=vision.gate,
            entry_point=entry_point(config.camera),
        )

    def detect(
        self, image: NDArray[np.uint8], predicted_features: ArrayLike | None = None
    ) -> Detection:
        """Find the markers in one image.

        Args:
            image: uint8, as ``camera.pixel_format`` says: (height, width, 3) B, G, R by default;
                `tautscope.pixels` has the shapes. A cropped view of a larger array is read in
                place.
            predicted_features: (4,) [px] where the bands should be, u_A, v_A, u_B, v_B. Features
                that are not finite (the model looks behind the camera, say) are no prediction.

        Returns:
            The features, or the reason why there are none: never an exception for what the image
            shows.

        Raises:
            FrameError: The image is not what the configured camera gives.
            FieldError: The prediction is not four numbers.
        """
        features, reason, regions = self._core.detect(
            self._layout.checked(image), _checked_prediction(predicted_features)
        )
        return Detection(features, reason, tuple(_region(row) for row in regions.tolist()))

    def regions_in(
        self, image: NDArray[np.uint8], windows: Sequence[tuple[int, int, int, int]]
    ) -> tuple[Region, ...]:
        """The regions in parts of an image, the rest of which is not read.

        A pixel is marker here exactly if it is in the whole image; a region ends where its window
        does.

        Args:
            image: As `detect`.
            windows: Left, top, and first column and row after the window [px]; what of it lies
                outside the image is left out.

        Returns:
            The regions of all windows, the largest first, at most 16.

        Raises:
            FrameError: As `detect`.
        """
        regions = self._core.regions_in(self._layout.checked(image), windows)
        return tuple(_region(row) for row in regions.tolist())

    def mask(self, image: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """What is above the threshold after the low-pass, for figures: bool (height, width).

        Raises:
            FrameError: As `detect`.
        """
        return self._core.mask(self._layout.checked(image))


def entry_point(camera: CameraConfig) -> tuple[float, float]:
    """Where the instrument enters the picture, u, v [px], possibly outside it.

    u = cx + fx x / z, v = cy + fy y / z, with (x, y, z) the guide's origin in the camera's frame
    [m]. Lens distortion is left out: that far from the axis its polynomial folds back. A guide
    beside or behind the camera counts as 84 degrees off its axis: only the direction matters then.

    Args:
        camera: Intrinsics and `camera_from_guide`.
    """
    x, y, z = camera.camera_from_guide.translation
    depth = max(z, float(np.hypot(x, y)) / 10)
    if depth == 0:
        return camera.cx, camera.cy
    return camera.cx + camera.fx * x / depth, camera.cy + camera.fy * y / depth


def _checked_prediction(predicted: ArrayLike | None) -> NDArray[np.float64] | None:
    if predicted is None:
        return None
    try:
        features = np.asarray(predicted, dtype=np.float64)
    except (TypeError, ValueError):
        features = np.empty(0)
    if features.shape != (4,):
        raise FieldError("predicted_features", predicted, "four numbers u_A, v_A, u_B, v_B [px]")
    return features


def _region(row: list[float]) -> Region:
    area, u, v, left, top, width, height = row
    return Region((u, v), int(area), (int(left), int(top), int(width), int(height)))
