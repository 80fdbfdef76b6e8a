"""Record of a calibration motion: motor positions, and the bands in the images."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.bands.labels import centroid, two_bands
from tautscope.calibration.images import Image, to_bgr
from tautscope.calibration.motion import DURATION, ImageRecorder, Progress, sweep_motion
from tautscope.config import CameraConfig, Config, PixelFormat
from tautscope.errors import SignalError
from tautscope.loop.construction import build_feature_model
from tautscope.loop.frame_layout import black, brightness, white
from tautscope.loop.kinematics import Floats
from tautscope.loop.rig import Rig
from tautscope.loop.signal_checks import as_numbers
from tautscope.loop.vision import Detection, MarkerDetector

IMAGE_PERIOD = 0.08
"""Least time between two images that are used [s]; neighbouring ones tell the same."""
LEAST_FOUND = 0.25
"""Share of the images in which the marker detection must find both bands for its features to be
used."""
MARGIN = 60
"""Pixels that are kept around the regions of the markers' colour [px]: tissue beside the bands."""
LARGEST_SPAN = 0.5
"""Largest distance between such regions, as a share of the image's sides: other things have that
colour, too."""


@dataclass(frozen=True, slots=True)
class Patch:
    """The part of an image in which the bands are.

    Attributes:
        left, top: Column and row of its first pixel in the image [px], even.
        pixels: The pixels, an image of the same format; of no size if none were kept.
    """

    left: int
    top: int
    pixels: Image

    @classmethod
    def cut(cls, image: Image, pixel_format: PixelFormat, box: Sequence[int]) -> Patch:
        """The part of an image in a box: left, top, and the column and row after the last [px].

        It is wider where pixels share U and V.
        """
        left, top, right, bottom = (edge // 2 * 2 for edge in np.add(box, (0, 0, 1, 1)))
        parts = [
            plane[top // each : bottom // each, left // each : right // each]
            for plane, each in _planes(image, pixel_format)
        ]
        if len(parts) == 1:
            return cls(left, top, parts[0].copy())
        together = np.concatenate([part.ravel() for part in parts])
        return cls(left, top, together.reshape(len(parts[0]) * 3 // 2, right - left))

    def image(self, camera: CameraConfig) -> Image:
        """The image with black in place of the pixels that were not kept."""
        whole = black(camera)
        if self.pixels.size:
            planes = (_planes(image, camera.pixel_format) for image in (whole, self.pixels))
            for (plane, each), (part, _) in zip(*planes, strict=True):
                left, top, (height, width) = self.left // each, self.top // each, part.shape[:2]
                plane[top : top + height, left : left + width] = part
        return whole


def _planes(image: Image, pixel_format: PixelFormat) -> list[tuple[Image, int]]:
    """The planes of an image as views, and the pixels per element along each side."""
    if image.ndim == 3:
        return [(image, 1)]
    height, width = len(image) * 2 // 3, image.shape[1]
    colour = image[height:].reshape(-1)
    if pixel_format == "nv12":
        return [(image[:height], 1), (colour.reshape(height // 2, width // 2, 2), 2)]
    u, v = colour.reshape(2, height // 2, width // 2)
    return [(image[:height], 1), (u, 2), (v, 2)]


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
        saturated: Median share of saturated pixels (B, G or R at 255, Y at 235) around the bands,
            or of the whole image where no pixels were kept.
    """

    time: Floats
    motors: Floats
    captured_at: Floats
    features: Floats
    patches: tuple[Patch, ...] = ()
    reasons: dict[str, int] = field(default_factory=dict)
    saturated: float = 0.0

    def __post_init__(self) -> None:
        ticks, images = np.size(self.time), np.size(self.captured_at)
        for name, shape in (
            ("time", (ticks,)),
            ("motors", (ticks, 3)),
            ("captured_at", (images,)),
            ("features", (images, 4)),
        ):
            values = as_numbers(name, getattr(self, name), f"numbers, shape {shape}")
            if values.shape != shape:
                raise SignalError(name, f"an array {values.shape}", f"shape {shape}")
        for name in ("time", "motors", "captured_at"):
            if not np.isfinite(getattr(self, name)).all():
                raise SignalError(name, "a number that is not finite", "finite numbers")
        if not ticks:
            raise SignalError("time", "no time", "that of each position of the motors")
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
        by_regions = self._by_regions(image, captured_at)
        bands = next((each for each in (features, by_regions) if np.isfinite(each).all()), None)
        patch, pixel_format = self._patch(image, detection, bands), self._camera.pixel_format
        bright = brightness(patch.pixels if patch.pixels.size else image, pixel_format)
        saturated = float((bright >= white(pixel_format)).any(axis=2).mean())
        self._images.append((captured_at, features, by_regions, patch, saturated))
        return detection

    def _by_regions(self, image: Image, captured_at: float) -> Floats:
        """The centroids of two regions of the bands' colour, ordered as the motors let expect."""
        index = max(bisect_right(self.ticks, captured_at, key=itemgetter(0)) - 1, 0)
        predicted = self._model.predict(self.ticks[index][1]) if self.ticks else None
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

    def _patch(self, image: Image, detection: Detection, bands: Floats | None) -> Patch:
        """The pixels around the regions near the bands, or around two near the largest one."""
        size, box = np.array([self._camera.width, self._camera.height]), [0, 0, 0, 0]
        if regions := detection.regions:
            known = [regions[0].centroid] if bands is None else bands.reshape(2, 2)
            middle = np.mean(known, axis=0)
            reach = LARGEST_SPAN / 2 * size
            near = [each for each in regions if (np.abs(each.centroid - middle) <= reach).all()]
            if len(near) > (bands is None):
                boxes = np.array([region.box for region in near])
                first, last = boxes[:, :2].min(axis=0), (boxes[:, :2] + boxes[:, 2:]).max(axis=0)
                low = np.maximum(first, middle - reach) - MARGIN
                high = np.minimum(last, middle + reach) + MARGIN
                box = [*np.maximum(low, 0).astype(int), *np.minimum(high, size).astype(int)]
        return Patch.cut(image, self._camera.pixel_format, box)


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
