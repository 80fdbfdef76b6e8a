"""Image to markers: Eq. (12) and Fig. 5.

Pixel coordinates are OpenCV's: u to the right, v down, the centre of the first pixel is (0, 0).
"""

import itertools
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from operator import itemgetter
from threading import Lock
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope import _core
from tautscope.config import Config, check_config
from tautscope.dof import Dof
from tautscope.errors import SignalError
from tautscope.loop.construction import build_feature_model
from tautscope.loop.frame_layout import FrameLayout
from tautscope.loop.signal_checks import as_numbers
from tautscope.loop.state_prediction import StatePrediction


class Region(NamedTuple):
    """8-connected pixels of the markers' colour.

    Attributes:
        centroid: Mean of the pixels' centres, u, v [px].
        area: Number of pixels.
        box: Bounding box: left, top, width, height [px].
    """

    centroid: tuple[float, float]
    area: int
    box: tuple[int, int, int, int]


class BandScore(NamedTuple):
    """Scores of a band.

    For bands that were recognised by the intensity because blur has left no edges (decision 0011)
    there is no outline to score: `edges` is the share of the intensity's variance that the fit
    explains, `growth` the standard deviation of the blur [px], and `inside`, `coverage`,
    `exclusive`, `spill` are 0.

    Attributes:
        inside: Share of the outline's area inside the image.
        coverage: Share of that part that has the markers' colour.
        exclusive: Share of that part that has it and is not inside the other band's outline.
        spill: Share of a ring around the outline that has the markers' colour.
        edges: Share of the outline at which an edge was found.
        growth: Growth of the outline along the band's axis [px].
        mahalanobis_squared: Squared Mahalanobis distance of both bands from their predicted
            positions.
        pixels: Number of pixels of the markers' colour inside the outline, those inside the other
            band's outline excluded [px].
        centroid: Centroid of the outline, u, v [px].
    """

    inside: float
    coverage: float
    exclusive: float
    spill: float
    edges: float
    growth: float
    mahalanobis_squared: float
    pixels: float
    centroid: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """Result of the marker detection in one image.

    Attributes:
        features: Measured features (4,) [px]: centroids of the bands, u_A, v_A, u_B, v_B. A is the
            proximal band. NaN for a band that was not found.
        covariance: Covariance of the features (4, 4) [px^2]; NaN likewise.
        reasons: Why each band was not found; empty if it was.
        regions: Regions of the markers' colour, the largest first, at most 32.
        discriminant: Discriminant that was used: 0 is the trained one, `vision.weights` and
            `vision.threshold`; others count `vision.alternatives` from 1.
    """

    features: NDArray[np.float64]
    covariance: NDArray[np.float64]
    reasons: tuple[str, str]
    scores: tuple[BandScore, BandScore]
    regions: tuple[Region, ...]
    discriminant: int

    def __repr__(self) -> str:
        bands = [
            reason or f"at ({u:.1f}, {v:.1f}) px"
            for reason, (u, v) in zip(self.reasons, self.features.reshape(2, 2), strict=True)
        ]
        return f"<Detection: band A {bands[0]}, band B {bands[1]}>"

    @property
    def found(self) -> tuple[bool, bool]:
        """Which bands were found."""
        a, b = self.reasons
        return not a, not b

    @property
    def valid(self) -> bool:
        """Whether both markers were found."""
        return all(self.found)

    @property
    def reason(self) -> str:
        """Why the detection is not valid; empty if it is."""
        a, b = self.reasons
        if a == b:
            return a
        named = (("A", a), ("B", b))
        return "; ".join(f"band {name}: {reason}" for name, reason in named if reason)


class MarkerDetector:
    """Finds the two bands of the instrument in camera images, Eq. (12) and Fig. 5.

    Each pixel is projected, w_b B + w_g G + w_r R. The projection is low-passed and thresholded,
    and pixels above the threshold are joined into 8-connected regions. The settings are in
    `config.vision`.

    The outlines of both bands, predicted by the instrument model, are fitted to the edges of the
    regions (decision 0011). A band is recognised if its position, its area, its edges and its
    surroundings agree with the prediction. The features are the centroids of the whole bands, even
    where a part is hidden, split by a highlight or outside the image. One band alone is recognised
    only if it cannot be the other one.

    - With an expectation, the bands are searched near it.
    - With predicted features alone, near the posture that explains them, with half of each DOF's
      `start_deviation`.
    - With neither, in the whole workspace of the experiment (decision 0032): both bands must be
      found, with an instrument between them.
    - If not both are found, in the whole workspace wherever the trained discriminant shows them
      clearly; camera and bands may then be 2 mm and 1 deg from where they are configured (decision
      0048).

    The arithmetic is in fixed point. With the largest sum of weights of one sign s, a low-passed
    value is within (1.25 + smoothing) * 255 * s / 8190 of the exact one: 0.082 grey levels by
    default.

    One detector may be shared between threads; calls take turns. No result depends on earlier
    images.

    Raises:
        ConfigError: All weights of the discriminant are zero, or too small or too large for the
            fixed-point arithmetic.
    """

    def __init__(self, config: Config) -> None:
        self._layout = FrameLayout(check_config(config).camera)
        self._model = build_feature_model(config)
        self._starts = workspace_starts(config)
        self._start_deviation = np.array([config[dof].start_deviation for dof in Dof])
        self._core = _core.MarkerDetector(
            self._model,
            config.camera.pixel_format,
            msgspec.to_builtins(config.vision),
            _posture_table(config, self._model),
            *self._starts,
        )

    def __repr__(self) -> str:
        return f"<MarkerDetector: {self._layout.pixel_format} images of shape {self._layout.shape}>"

    def detect(
        self,
        image: NDArray[np.uint8],
        predicted_features: ArrayLike | None = None,
        expectation: StatePrediction | None = None,
    ) -> Detection:
        """Detect the markers in one image.

        Args:
            image: uint8 array in ``camera.pixel_format``: (height, width, 3) B, G, R by default;
                `tautscope.loop.frame_layout` lists the shapes. A cropped view of a larger array is
                read in place.
            predicted_features: Predicted centroids (4,) [px], u_A, v_A, u_B, v_B. Features that are
                not finite (the model is behind the camera, say) are ignored.
            expectation: Prediction of the state with its standard deviations; with it the predicted
                features are ignored.

        Returns:
            The features, or the reason why there are none. What the image shows never raises an
            exception.

        Raises:
            FrameError: The image is not what the configured camera gives.
            SignalError: The predicted features are not four numbers, or the expectation is no
                `StatePrediction` of three.
        """
        prior = self._prior(predicted_features, expectation)
        features, covariance, scores, reasons, regions, discriminant = self._core.detect(
            self._layout.checked(image), prior
        )
        a, b = (BandScore._make((*row, (u, v))) for *row, u, v in scores.tolist())
        found = tuple(map(Region._make, regions))
        return Detection(features, covariance, reasons, (a, b), found, discriminant)

    def _prior(
        self, predicted_features: ArrayLike | None, expectation: StatePrediction | None
    ) -> tuple[NDArray[np.float64], ...] | None:
        """State (3,), standard deviations (3,) and geometry (3,); None if it may be anywhere."""
        predicted = np.full(4, np.nan)
        if predicted_features is not None:
            allowed = "four numbers u_A, v_A, u_B, v_B [px]"
            predicted = as_numbers("predicted_features", predicted_features, allowed)
            if predicted.shape != (4,):
                raise SignalError("predicted_features", predicted_features, allowed)
        if expectation is not None:
            return tuple(_prior_part(expectation, name) for name in ("state", "std", "geometry"))
        if not np.isfinite(predicted).all():
            return None
        starts, broad = self._starts
        std = np.full(4, 5.0)
        fits = (self._model.nearest_state(start, broad, predicted, std) for start in starts)
        best = min(filter(None, fits), key=itemgetter(1), default=None)
        return None if best is None else (best[0], self._start_deviation / 2, np.zeros(3))

    def regions_in(
        self, image: NDArray[np.uint8], windows: Sequence[tuple[int, int, int, int]]
    ) -> tuple[Region, ...]:
        """The regions in windows of an image, the largest first, at most 32; the rest is not read.

        A pixel is marker exactly if it is in the whole image. A region ends where its window does.
        A window is left, top, and the column and row after the last [px]; a part outside the image
        is ignored.

        Raises:
            FrameError: As `detect`.
            SignalError: A window is not four whole numbers.
        """
        allowed = "windows of four whole numbers: left, top, right, bottom [px]"
        found = as_numbers("windows", windows, allowed)
        if found.size and (found.shape[1:] != (4,) or (found != np.floor(found)).any()):
            raise SignalError("windows", found.tolist(), allowed)
        inside = found.reshape(-1, 4).clip(0, max(self._layout.shape)).astype(int).tolist()
        regions = self._core.regions_in(self._layout.checked(image), inside)
        return tuple(map(Region._make, regions))

    def mask(self, image: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """The marker pixels, above the threshold after the low-pass: bool (height, width).

        Raises:
            FrameError: As `detect`.
        """
        return self._core.mask(self._layout.checked(image))


def _prior_part(expectation: StatePrediction, name: str) -> NDArray[np.float64]:
    if not isinstance(expectation, StatePrediction):
        raise SignalError("expectation", type(expectation).__name__, "a StatePrediction")
    field, allowed = f"expectation.{name}", "3 numbers"
    found = as_numbers(field, getattr(expectation, name), allowed)
    if found.shape != (3,):
        raise SignalError(field, found.tolist(), allowed)
    return found


def workspace_starts(config: Config) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """States that cover the workspace of the experiment, and standard deviations in between."""
    sines = [config.experiment[dof] for dof in Dof]
    grid = itertools.product(
        *(
            sine.centre + sine.amplitude * np.linspace(-1 + 1 / n, 1 - 1 / n, n)
            for sine, n in zip(sines, (2, 5, 2), strict=True)
        )
    )
    states = np.array([[sine.centre for sine in sines], *grid])
    return states, np.array([sine.amplitude for sine in sines])


_MOST_TABLES = 8
_tables: dict[Hashable, _core.PostureTable] = {}
_tables_lock = Lock()


def _posture_table(config: Config, model: _core.FeatureModel) -> _core.PostureTable:
    """Images of the bands in postures of the whole workspace; detectors of a geometry share them.

    They take as long as ten images.
    """
    camera = config.camera
    lens = camera.fx, camera.fy, camera.cx, camera.cy, camera.distortion
    key = (config.instrument, config.experiment, lens, camera.camera_from_guide)
    with _tables_lock:
        table = _tables.get(key)
        if table is None:
            for oldest in list(_tables)[: 1 - _MOST_TABLES]:
                del _tables[oldest]
            table = _tables[key] = _core.PostureTable(model, _workspace(config))
    return table


def _workspace(config: Config) -> NDArray[np.float64]:
    """Postures (n, 3) that cover the workspace of the experiment."""
    sines = [config.experiment[dof] for dof in Dof]
    axes = (
        sine.centre + 1.1 * sine.amplitude * np.linspace(-1, 1, n)
        for sine, n in zip(sines, (13, 45, 23), strict=True)
    )
    return np.array(list(itertools.product(*axes)))
