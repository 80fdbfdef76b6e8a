"""Image to markers: Eq. (12) and Fig. 5.

Pixel coordinates are OpenCV's: u to the right, v down, the centre of the first pixel is (0, 0).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope import _core
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import FieldError
from tautscope.loop.construction import build_feature_model
from tautscope.loop.frame_layout import FrameLayout
from tautscope.loop.state_prediction import StatePrediction


class Region(NamedTuple):
    """Pixels of the markers' colour that touch each other along edges or at corners.

    Attributes:
        centroid: Mean of the pixels' centres, u, v [px].
        area: Number of pixels.
        box: Bounding box: left, top, width, height [px].
    """

    centroid: tuple[float, float]
    area: int
    box: tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks for a band.

    Where the bands were placed by their light, because blur has left no edges (decision 0011),
    there is no outline to judge: `edges` is the share of the light's variance that the two bands
    explain, `bloom` the spread of the blur [px], and `inside`, `coverage`, `own`, `spill` are 0.

    Attributes:
        inside: Share of its outline's area that is in the image.
        coverage: Share of that which has the markers' colour.
        own: Share of that which the other band's outline does not have too.
        spill: Share of a ring around it that has the markers' colour.
        edges: Share of its outline at which the colour ends.
        bloom: How much the outline had to grow [px].
        surprise: Squared Mahalanobis distance of both bands from where they were expected.
        centroid: Where the outline was laid, u, v [px].
    """

    inside: float
    coverage: float
    own: float
    spill: float
    edges: float
    bloom: float
    surprise: float
    centroid: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """What a frame shows.

    Attributes:
        features: (4,) [px] the measured features: centroids of the bands, u_A, v_A, u_B, v_B, A the
            proximal band. NaN for a band that was not found.
        covariance: (4, 4) [px^2] of the features; NaN likewise.
        reasons: Per band why it was not found; empty if it was.
        evidence: Per band what speaks for it.
        regions: What has the markers' colour, the largest first, at most 16.
        discriminant: Which discriminant it rests on: 0 is the trained one, `vision.weights` and
            `vision.threshold`; others count `vision.alternatives` from 1.
    """

    features: NDArray[np.float64]
    covariance: NDArray[np.float64]
    reasons: tuple[str, str]
    evidence: tuple[Evidence, Evidence]
    regions: tuple[Region, ...]
    discriminant: int

    @property
    def found(self) -> tuple[bool, bool]:
        """Which bands were found."""
        a, b = self.reasons
        return not a, not b

    @property
    def valid(self) -> bool:
        """Whether both markers were found and can be trusted."""
        return all(self.found)

    @property
    def colours_drifted(self) -> bool:
        """Whether a band was found, but not by the trained discriminant: exposure or white balance
        have left the training, and `ColorDiscriminant.fit` should be given new pixels.
        """  # noqa: D205
        return self.discriminant > 0 and any(self.found)

    @property
    def reason(self) -> str:
        """Why it is not valid; empty if it is."""
        a, b = self.reasons
        if a == b:
            return a
        named = (("A", a), ("B", b))
        return "; ".join(f"band {name}: {reason}" for name, reason in named if reason)


class MarkerDetector:
    """Finds the two bands of the instrument in camera images, Eq. (12) and Fig. 5.

    Each pixel is projected, w_b B + w_g G + w_r R, the projection low-passed and thresholded, the
    pixels above the threshold joined into 8-connected regions. `config.vision` has the numbers.

    What has the markers' colour is a band only if it looks like one (decision 0011): the outlines
    of both bands, as the model of the instrument draws them, are laid over the regions, and the
    place, the size, the outline's edges and what is around must agree. A part that is hidden,
    split by a highlight or outside the image is no part of the measurement: the features are the
    centroids of the whole bands. One band alone is found only where it is surely not the other.

    - With an expectation, both are sought around it.
    - With predicted features alone, the same around the posture that explains them, with half of
      each DOF's `start_deviation`.
    - With neither, in the whole workspace of the experiment, and only what is all but whole counts.

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
        self._model = build_feature_model(config)
        self._starts = _starts(config)
        self._start_deviation = np.array([config[dof].start_deviation for dof in Dof])
        self._core = _core.MarkerDetector(
            self._model,
            pixel_format=config.camera.pixel_format,
            weights=vision.weights,
            threshold=vision.threshold,
            smoothing=vision.smoothing,
            minimum_area=vision.minimum_area,
            alternatives=[(weights, threshold) for weights, threshold in vision.alternatives],
            model_deviation=vision.model_deviation,
            demands=(
                vision.least_inside,
                vision.least_coverage,
                vision.largest_spill,
                vision.least_edges,
                vision.least_edges_on_average,
                vision.least_edges_alone,
                vision.largest_surprise,
            ),
        )

    def detect(
        self,
        image: NDArray[np.uint8],
        predicted_features: ArrayLike | None = None,
        expectation: StatePrediction | None = None,
    ) -> Detection:
        """Find the markers in one image.

        Args:
            image: uint8, as ``camera.pixel_format`` says: (height, width, 3) B, G, R by default;
                `tautscope.loop.frame_layout` has the shapes. A cropped view of a larger array is
                read in place.
            predicted_features: (4,) [px] where the bands should be, u_A, v_A, u_B, v_B. Features
                that are not finite (the model looks behind the camera, say) are no prediction.
            expectation: Where the instrument is believed to be and how sure that is; with it the
                predicted features are not looked at.

        Returns:
            The features, or the reason why there are none: never an exception for what the image
            shows.

        Raises:
            FrameError: The image is not what the configured camera gives.
            FieldError: The prediction is not four numbers.
        """
        predicted = _checked_prediction(predicted_features)
        states, deviation = self._beliefs(predicted, expectation)
        features, covariance, evidence, reasons, regions, discriminant = self._core.detect(
            self._layout.checked(image), states, deviation
        )
        a, b = (_evidence(row) for row in evidence.tolist())
        found = tuple(map(Region._make, regions))
        return Detection(features, covariance, reasons, (a, b), found, discriminant)

    def _beliefs(
        self, predicted: NDArray[np.float64] | None, expectation: StatePrediction | None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Where the instrument may be: states (n, 3) and their common deviations (3,)."""
        if expectation is not None:
            return np.asarray(expectation.state)[None], np.asarray(expectation.std)
        starts, broad = self._starts
        if predicted is None or not np.isfinite(predicted).all():
            return starts, broad
        fits = [
            fit
            for start in starts
            if (fit := self._model.nearest_state(start, broad, predicted, np.full(4, 5.0)))
        ]
        if not fits:
            return starts, broad
        state, _ = min(fits, key=lambda fit: fit[1])
        return state[None], self._start_deviation / 2

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
        return tuple(map(Region._make, regions))

    def mask(self, image: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """What is above the threshold after the low-pass, for figures: bool (height, width).

        Raises:
            FrameError: As `detect`.
        """
        return self._core.mask(self._layout.checked(image))


def _starts(config: Config) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """States that cover the workspace of the experiment, and deviations that fill the gaps."""
    sines = [config.experiment[dof] for dof in Dof]
    grid = itertools.product(
        *(
            sine.centre + sine.amplitude * np.linspace(-1 + 1 / n, 1 - 1 / n, n)
            for sine, n in zip(sines, (2, 5, 2), strict=True)
        )
    )
    centre = [sine.centre for sine in sines]
    states = np.array([centre, *grid])
    return states, np.array([sine.amplitude for sine in sines])


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


def _evidence(row: list[float]) -> Evidence:
    inside, coverage, own, spill, edges, bloom, surprise, u, v = row
    return Evidence(inside, coverage, own, spill, edges, bloom, surprise, (u, v))
