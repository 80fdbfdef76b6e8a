"""Bands found by their motion: two regions of one colour that move with the motors."""

import itertools
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.calibration.bands import labels
from tautscope.calibration.bands.labels import LEAST_AREA, LabelledImage, Mask
from tautscope.calibration.colour import fit_discriminant
from tautscope.calibration.images import Image, to_bgr
from tautscope.calibration.motion import (
    ImageRecorder,
    Progress,
    Sines,
    article_sines,
    feasible_periods,
)
from tautscope.config import Config
from tautscope.errors import CalibrationError, FieldError
from tautscope.loop.kinematics import Floats
from tautscope.loop.rig import Rig
from tautscope.loop.signal_checks import as_numbers

DURATION = 10.0
"""Duration of the motion, unless the motors are slow [s]."""
MOST_IMAGES = 60
_SHARE = (1.0, 0.0, 0.6)
"""Amplitude relative to that of the experiment."""
_TURNS = (1, 1, 2)
"""Periods in the motion."""
LEAST_IMAGES = 30
"""A sequence has more once every second image was dropped."""
LEAST_CHANGE = 24.0
"""A pixel has changed if a channel differs from its median by more [grey levels]."""
LEAST_SHARE = 0.6
"""Two bands must be found in at least this share of the images."""
LEAST_FOLLOWING = 0.5
"""Share of the variance of their position that the motors must explain."""
_CLUSTERS = 6
_SHARE_OF_TISSUE = 1e-6
"""A colour is tissue if its cell of the colour space has more of the unmoved pixels."""
_CELL = 8
"""Size of a cell of the colour space [grey levels]."""
_ITERATIONS = 2
"""Repetitions of the fit with the regions of the fit before."""
_MOST_PIXELS = 40_000
"""Largest number of pixels that are clustered."""
_LEAST_TISSUE = 0.3
"""Least share of the pixels that never change."""
_LAGS = (0.0, 0.5, 1.0)
"""Delays of the motors that may explain the position: slack delays the tip [s]."""


class ImageSequence(ImageRecorder):
    """Collects images of a moving instrument, evenly in time and at most `MOST_IMAGES`.

    Attributes:
        images: (n) B, G, R.
        times: (n,) capture times [s].
    """

    def __init__(self, config: Config) -> None:
        super().__init__(DURATION / MOST_IMAGES)
        self.images: list[Image] = []
        self.times: list[float] = []
        self._format = config.camera.pixel_format

    def add_image(self, image: Image, captured_at: float) -> None:
        """Keep an image; every second one is dropped where there are too many."""
        self.used(captured_at)
        self.images.append(to_bgr(image, self._format).copy())
        self.times.append(captured_at)
        if len(self.images) > MOST_IMAGES:
            self.images, self.times = self.images[::2], self.times[::2]
            self.period *= 2

    @property
    def positions(self) -> Floats:
        """(n, 3) positions of the motors at the times of the images [m, rad, rad]."""
        at, applied = (np.array(column) for column in zip(*self.ticks, strict=True))
        return np.column_stack([np.interp(self.times, at, dof) for dof in applied.T])

    def label(self) -> list[LabelledImage]:
        """The images in which the bands were found, see `find_moving_bands`."""
        self.check_is_complete(len(self.images))
        return find_moving_bands(self.images, self.times, self.positions)


def record_motion(rig: Rig, config: Config, progress: Progress | None = None) -> ImageSequence:
    """Move insertion and bending, as `move_rig`, within the experiment's range; keep images."""
    centre, amplitude = article_sines(config)
    amplitude, turns = amplitude * _SHARE, np.array(_TURNS)
    periods = feasible_periods(config, amplitude, DURATION / turns)
    found = ImageSequence(config)
    motion = Sines(centre, amplitude, periods, float((periods * turns).max()))
    found.move(rig, config, motion, progress)
    return found


@dataclass(frozen=True)
class _Candidate:
    """A colour, and the two regions that it has in each image; None where it has none."""

    weights: tuple[float, float, float]
    threshold: float
    bands: tuple[tuple[Mask, Mask] | None, ...]
    following: float

    @property
    def share(self) -> float:
        """Share of the images with two bands."""
        return sum(each is not None for each in self.bands) / len(self.bands)

    @property
    def score(self) -> float:
        return self.share * self.following


def find_moving_bands(
    images: Sequence[Image], times: ArrayLike, positions: ArrayLike
) -> list[LabelledImage]:
    """Label the images of a sweep.

    Pixels that differ from their median over time, in colours that unmoved pixels do not have, are
    of the instrument. They are clustered by colour. The bands are the cluster whose discriminant
    leaves two compact regions of similar size, and nothing else, in most images, and whose position
    follows the motors. No geometry is used.

    Wrong when the scope moves against the tissue, or another part of the instrument has two patches
    of a colour of its own.

    Args:
        images: (n) B, G, R of one camera, `LEAST_IMAGES` or more.
        times: (n,) when they were captured [s].
        positions: (n, 3) positions of the motors then [m, rad, rad].

    Returns:
        The images in which both bands were found.

    Raises:
        FieldError: Numbers of images, times and positions differ, or are too few.
        CalibrationError: Nothing moved, or no two bands were found.
    """
    stamps = as_numbers("times", times, "numbers, one per image")
    motors = as_numbers("positions", positions, "numbers, one row per image")
    if len(images) < LEAST_IMAGES:
        raise FieldError("images", len(images), f"at least {LEAST_IMAGES}")
    for name, array, shape in (
        ("times", stamps, (len(images),)),
        ("positions", motors, (len(images), 3)),
    ):
        if array.shape != shape:
            raise FieldError(name, array.shape, f"{shape}, one row per image")
    moving, tissue = _split(images)
    regressors = _regressors(stamps, motors)
    best = _Candidate((0.0, 0.0, 0.0), 0.0, (None,), 0.0)
    for own, others in _clusters(moving):
        with suppress(FieldError):  # all pixels of one colour
            colour = fit_discriminant(own, np.concatenate([tissue, others]))
            candidate = _evaluate(images[::2], *colour, regressors[::2])
            best = max(best, candidate, key=lambda each: (each.score, each.share))
    if best.share < LEAST_SHARE:
        raise CalibrationError(
            "No colour of the moving pixels has two bands in most images; the best has them in "
            f"{best.share:.0%}",
            "Are both bands in view all the time, matt, and of a colour of their own? Else use "
            "--click, or masks",
        )
    best = _evaluate(images, best.weights, best.threshold, regressors)
    if best.following < LEAST_FOLLOWING:
        raise CalibrationError(
            f"The motors explain only {best.following:.0%} of the motion of the bands",
            "Does the instrument follow its motors, and do images and positions belong together?",
        )
    for _ in range(_ITERATIONS):
        found = _labelled(images, best)
        marker = np.concatenate([each.pixels(label) for each in found for label in (1, 2)])
        background = np.concatenate([each.pixels(0)[::31] for each in found])
        refined = _evaluate(images, *fit_discriminant(marker, background), regressors)
        if refined.score < best.score:
            break
        best = refined
    return _labelled(images, best)


def _labelled(images: Sequence[Image], candidate: _Candidate) -> list[LabelledImage]:
    pairs = zip(images, candidate.bands, strict=True)
    return [labels.labelled(image, bands) for image, bands in pairs if bands is not None]


def _split(images: Sequence[Image]) -> tuple[Image, Image]:
    """Pixels (n, 3) of what moved, in colours that what did not move has not; and the latter."""
    height, width = images[0].shape[:2]
    half = width // 2, height // 2
    halved = [cv2.resize(each, half, interpolation=cv2.INTER_AREA) for each in images]
    small = np.stack([_matched(image, halved[len(halved) // 2]) for image in halved])
    median = np.median(small[::2], axis=0).astype(np.int16)
    changed = (np.abs(small.astype(np.int16) - median) > LEAST_CHANGE).any(axis=3)
    ever = cv2.dilate(changed.any(axis=0).astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    if ever.mean() > 1 - _LEAST_TISSUE:
        raise CalibrationError(
            f"{ever.mean():.0%} of the image changes during the sweep",
            "Hold the scope still, and switch off automatic exposure. Else use --click, or masks",
        )
    tissue = small[::5][:, ~ever].reshape(-1, 3)
    size = 256 // _CELL
    counts = np.zeros((size + 2,) * 3)
    np.add.at(counts, tuple((tissue // _CELL + 1).T.astype(int)), 1)
    # Neighbouring cells too: a colour is not unlike tissue because of its noise.
    near = counts.copy()
    for shift in itertools.product((-1, 0, 1), repeat=3):
        np.maximum(near, np.roll(counts, shift, axis=(0, 1, 2)), out=near)
    moving = small[changed]
    cells = tuple((moving // _CELL + 1).T.astype(int))
    own = moving[near[cells] <= _SHARE_OF_TISSUE * len(tissue)]
    if len(own) < LEAST_AREA * len(images) / 4:
        raise CalibrationError(
            f"Hardly anything in the images moves: {changed.mean():.2%} of the pixels, of which "
            f"{len(own) / max(len(moving), 1):.0%} have a colour that the tissue has not",
            "Is the instrument in view, are the motors coupled to it, and is the image not "
            "overexposed? Else use --click, or masks",
        )
    own = own[:: -(-len(own) // _MOST_PIXELS)]
    return own, tissue[:: -(-len(tissue) // (5 * _MOST_PIXELS))]


def _matched(image: NDArray[Any], other: NDArray[Any]) -> Image:
    """The image with the brightness of another: the exposure may be automatic."""
    gain = np.median((other.sum(axis=2) + 10.0) / (image.sum(axis=2) + 10.0))
    return np.asarray(cv2.convertScaleAbs(image, alpha=float(gain)), np.uint8)


def _clusters(pixels: Image) -> list[tuple[Image, Image]]:
    """The pixels of each cluster of colours, nearly independent of brightness, and the others."""
    values = pixels.astype(np.float32)
    total = values.sum(axis=1, keepdims=True) + 10
    colours = np.hstack([3 * values / total, 0.15 * np.log(total / 100)]).astype(np.float32)
    cv2.setRNGSeed(0)
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-4)
    nothing = np.empty(0, np.int32)
    count = min(_CLUSTERS, len(colours))
    _, names, _ = cv2.kmeans(colours, count, nothing, criteria, 4, cv2.KMEANS_PP_CENTERS)
    members = [names.ravel() == k for k in range(count)]
    return [(pixels[own], pixels[~own]) for own in members if own.sum() > LEAST_AREA]


def _evaluate(
    images: Sequence[Image],
    weights: tuple[float, float, float],
    threshold: float,
    regressors: Floats,
) -> _Candidate:
    bands = tuple(labels.two_bands(image, weights, threshold) for image in images)
    is_found = np.array([each is not None for each in bands])
    if is_found.mean() < LEAST_SHARE / 2:
        return _Candidate(weights, threshold, bands, 0.0)
    # The mean of the centroids does not depend on the order of the bands.
    found = [[labels.centroid(band) for band in pair] for pair in bands if pair is not None]
    middle = np.mean(found, axis=1)
    rows = regressors[is_found]
    solution, *_ = np.linalg.lstsq(rows, middle, rcond=None)
    variance = middle.var(axis=0).sum()
    # The adjusted share: as many regressors explain much of any few positions.
    free = len(rows) - rows.shape[1]
    left = (middle - rows @ solution).var(axis=0).sum() * (len(rows) - 1) / max(free, 1)
    following = max(1 - left / variance, 0.0) if variance > 1 and free > 0 else 0.0
    return _Candidate(weights, threshold, bands, float(following))


def _regressors(times: Floats, positions: Floats) -> Floats:
    """The positions now and before: (n, columns), with a constant."""
    spread = np.ptp(positions, axis=0)
    moved = positions[:, spread > 0] / spread[spread > 0]
    if not moved.shape[1]:
        raise CalibrationError("The motors did not move", "Are the drives enabled?")
    delayed = [np.interp(times - lag, times, dof) for lag in _LAGS for dof in moved.T]
    return np.column_stack([np.ones(len(times)), *delayed])
