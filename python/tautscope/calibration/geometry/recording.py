"""Record of a calibration motion: motor positions, and the bands in the images."""

from __future__ import annotations

import re
from collections import Counter
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.bands.labels import centroid, two_bands
from tautscope.calibration.images import Image, to_bgr
from tautscope.calibration.motion import DURATION, ImageRecorder, Progress, sweep_motion
from tautscope.config import CameraConfig, Config
from tautscope.errors import SignalError
from tautscope.loop.construction import build_feature_model
from tautscope.loop.frame_layout import FrameLayout
from tautscope.loop.kinematics import Floats
from tautscope.loop.rig import Rig
from tautscope.loop.vision import Detection, MarkerDetector

IMAGE_PERIOD = 0.08
"""Least time between two images that are used [s]; neighbouring ones tell the same."""
LEAST_FOUND = 0.25
"""Share of the images in which the marker detection must find both bands for its features to be
used."""
MARGIN = 60
"""Pixels that are kept around the regions of the markers' colour [px]: tissue beside the bands."""


@dataclass(frozen=True, slots=True)
class Patch:
    """The part of an image in which the bands are.

    Attributes:
        left, top: Column and row of its first pixel in the image [px].
        pixels: The pixels; the whole image in a format without one element per pixel.
    """

    left: int
    top: int
    pixels: Image

    def image(self, camera: CameraConfig) -> Image:
        """The image with black in place of the pixels that were not kept."""
        shape = FrameLayout(camera).shape
        if self.pixels.shape == shape:
            return self.pixels
        whole = np.zeros(shape, np.uint8)
        height, width = self.pixels.shape[:2]
        whole[self.top : self.top + height, self.left : self.left + width] = self.pixels
        return whole


@dataclass(frozen=True, eq=False)
class Recording:
    """A calibration motion of the motors, and the features of the bands.

    Attributes:
        time: (n,) [s], increasing.
        motors: (n, 3) positions of the drives at these times [m, rad, rad].
        captured_at: (images,) stamped capture times [s, the same clock], in order.
        features: (images, 4) u and v of bands A and B [px]; NaN where a band was not found.
        patches: The images, for a second detection with the fitted geometry; empty without images.
        reasons: Why bands were not found: text -> number of images.
        saturated: Median share of saturated pixels (a channel at 255) around the bands, or of the
            whole image in a format without one element per pixel.
    """

    time: Floats
    motors: Floats
    captured_at: Floats
    features: Floats
    patches: tuple[Patch, ...] = ()
    reasons: dict[str, int] = field(default_factory=dict)
    saturated: float = 0.0

    def __post_init__(self) -> None:
        ticks, images = len(self.time), len(self.captured_at)
        for name, shape in (
            ("time", (ticks,)),
            ("motors", (ticks, 3)),
            ("captured_at", (images,)),
            ("features", (images, 4)),
        ):
            found = np.shape(getattr(self, name))
            if found != shape:
                raise SignalError(name, f"an array {found}", f"shape {shape}")
        for name in ("time", "motors", "captured_at"):
            if not np.isfinite(getattr(self, name)).all():
                raise SignalError(name, "a number that is not finite", "finite numbers")
        if (np.diff(self.captured_at) < 0).any():
            raise SignalError("captured_at", "a time before the last", "times in order")
        if (np.diff(self.time) <= 0).any():
            raise SignalError("time", "a time that does not increase", "increasing times")
        if self.patches and len(self.patches) != images:
            raise SignalError("patches", f"{len(self.patches)} patches", f"{images}, one per image")

    @property
    def found(self) -> NDArray[np.bool_]:
        """(images,) whether both bands were found."""
        return np.asarray(np.isfinite(self.features).all(axis=1))

    def with_bands(self) -> Recording:
        """The same of the images with both bands, without their pixels."""
        found = self.found
        stamps, features = self.captured_at[found], self.features[found]
        return replace(self, captured_at=stamps, features=features, patches=())


class Recorder(ImageRecorder):
    """Collects a `Recording`: motor positions, and images in which the bands are searched.

    The bands are searched without a prediction, because the configured geometry is what is unknown.
    Where it is so wrong that no posture explains most of the images, the centroids of the two
    regions of the bands' colour are taken instead, until the fit searches again.
    """

    def __init__(self, config: Config, executor: Executor | None = None) -> None:
        super().__init__(IMAGE_PERIOD, executor)
        self._camera, self._vision = config.camera, config.vision
        self._detector = MarkerDetector(config)
        self._model = build_feature_model(config)
        self._images: list[tuple[float, Floats, Floats, Patch, float]] = []
        self._reasons = Counter[str]()

    def add_image(self, image: Image, captured_at: float) -> Detection:
        """Search the bands in an image, and keep its features and its pixels around the bands.

        Raises:
            FrameError: The image is not what the configured camera gives.
        """
        self.used(captured_at)
        detection = self._detector.detect(image)
        if not detection.valid:
            self._reasons[generic(detection.reason)] += 1
        features = detection.features if detection.valid else np.full(4, np.nan)
        patch = self._patch(image, detection)
        pixels = patch.pixels
        if pixels.ndim == 2:  # planes: brightness, and below it colour
            pixels = pixels[: self._camera.height, :, None]
        saturated = float(np.mean(pixels.max(axis=-1) == 255)) if pixels.size else 0.0
        self._images.append((captured_at, features, self._by_regions(image), patch, saturated))
        return detection

    def _by_regions(self, image: Image) -> Floats:
        """The centroids of two regions of the bands' colour, ordered as the motors let expect."""
        predicted = self._model.predict(self.ticks[-1][1]) if self.ticks else None
        pixels = to_bgr(image, self._camera.pixel_format)
        bands = two_bands(pixels, self._vision.weights, self._vision.threshold)
        if predicted is None or bands is None:
            return np.full(4, np.nan)
        first, second = (centroid(band) for band in bands)
        features = predicted[0]
        is_ordered = (second - first) @ (features[2:] - features[:2]) > 0
        return np.concatenate([first, second] if is_ordered else [second, first])

    def recording(self) -> Recording:
        """What was collected, in the order of capture; errors as `check_is_complete`."""
        self.check_is_complete(len(self._images))
        times, motors = zip(*self.ticks, strict=True)
        images = sorted(self._images, key=lambda each: each[0])
        captured_at, features, by_regions, patches, saturated = zip(*images, strict=True)
        if np.isfinite(features).all(axis=1).mean() < LEAST_FOUND:
            features = by_regions
        columns = times, motors, captured_at, features
        time, positions, stamps, points = (np.array(each) for each in columns)
        reasons, share = dict(self._reasons.most_common()), float(np.median(saturated))
        return Recording(time, positions, stamps, points, patches, reasons, share)

    def _patch(self, image: Image, detection: Detection) -> Patch:
        camera = self._camera
        if image.shape[:2] != (camera.height, camera.width) or not detection.regions:
            return Patch(0, 0, image.copy())
        boxes = np.array([region.box for region in detection.regions])
        left, top = np.maximum(boxes[:, :2].min(axis=0) - MARGIN, 0)
        right, bottom = (boxes[:, :2] + boxes[:, 2:]).max(axis=0) + MARGIN
        return Patch(int(left), int(top), image[top:bottom, left:right].copy())


def generic(reason: str) -> str:
    """The reason why bands were not found, without its numbers."""
    return re.sub(r"[\d.]+", "N", reason)


def sweep(
    rig: Rig,
    config: Config,
    *,
    duration: float = DURATION,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Move all degrees of freedom at once (`sweep_motion`), and record motors and images.

    As `move_rig`, with the duration [s] and an executor as of `ImageRecorder`.

    Raises:
        RecordError: No image arrived.
        FrameError: An image is not what the configured camera gives.
        TautscopeError: As `move_rig`.
    """
    recorder = Recorder(config, executor)
    recorder.move(rig, config, sweep_motion(config, duration), progress)
    return recorder.recording()
