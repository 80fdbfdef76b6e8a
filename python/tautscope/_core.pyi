from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "DETECTORS",
    "MEANINGS",
    "MOST_DOFS",
    "MOST_RANGE",
    "MOST_SENSORS",
    "MOST_VALUES",
    "OFFSET_LIMIT",
    "SPEED",
    "Camera",
    "Compensator",
    "Estimator",
    "FeatureModel",
    "Hysteresis",
    "Instrument",
    "MarkerDetector",
    "Play",
    "PostureTable",
    "Reduction",
    "Renderer",
    "StateEstimator",
    "TipFilter",
    "__version__",
    "label_regions",
    "move_along_curve",
    "track_coefficients",
]

__version__: str
DETECTORS: tuple[str, ...]
MEANINGS: tuple[str, ...]
MOST_DOFS: int
MOST_SENSORS: int
MOST_VALUES: int
MOST_RANGE: float
OFFSET_LIMIT: float
SPEED: float

# Models, estimation, compensation, supervision: crates/core.

_Floats = NDArray[np.float64]
_Flags = NDArray[np.bool_]
_Vector3 = tuple[float, float, float]
_Vector8 = tuple[float, float, float, float, float, float, float, float]
_Band = tuple[float, _Floats, _Floats, _Floats]
_Region = tuple[tuple[float, float], int, tuple[int, int, int, int]]
_Triggers = tuple[str | None, str | None]

@final
class Play:
    def __new__(cls, *, delta_minus: float, delta_plus: float, output: float = 0.0) -> Play: ...
    def step(self, input: float) -> float: ...
    def run(self, inputs: ArrayLike) -> _Floats: ...
    @property
    def output(self) -> float: ...
    @property
    def delta_minus(self) -> float: ...
    @property
    def delta_plus(self) -> float: ...
    @property
    def width(self) -> float: ...

# A number for one axis, or an array (n,) where a setting is one.
_PerAxis = Any

@final
class Compensator:
    def __new__(
        cls,
        *,
        free_gain: ArrayLike,
        gain_limit: ArrayLike,
        delta_minus: ArrayLike,
        delta_plus: ArrayLike,
        recovery: ArrayLike = 0.0,
    ) -> Compensator: ...
    def step(self, reference: ArrayLike) -> _PerAxis: ...
    def run(self, references: ArrayLike) -> _Floats: ...
    def set_offsets(self, delta_minus: ArrayLike, delta_plus: ArrayLike) -> None: ...
    @property
    def command(self) -> _PerAxis: ...
    @property
    def position(self) -> _PerAxis: ...
    @property
    def predicted_state(self) -> _PerAxis: ...
    @property
    def delta_minus(self) -> _PerAxis: ...
    @property
    def delta_plus(self) -> _PerAxis: ...

@final
class Estimator:
    def __new__(
        cls,
        *,
        update_distance: ArrayLike,
        contact_tolerance: ArrayLike,
        smoothing_factor: ArrayLike,
        delta_minus: ArrayLike,
        delta_plus: ArrayLike,
    ) -> Estimator: ...
    @overload
    def update(self, command: float, measured: float) -> _Triggers: ...
    @overload
    def update(self, command: ArrayLike, measured: ArrayLike) -> tuple[_Triggers, ...]: ...
    def predict(self, command: ArrayLike) -> _PerAxis: ...
    def run(self, commands: ArrayLike, measured: ArrayLike) -> tuple[_Floats, _Floats, _Floats]: ...
    @property
    def delta_minus(self) -> _PerAxis: ...
    @property
    def delta_plus(self) -> _PerAxis: ...

@final
class Instrument:
    def __new__(
        cls,
        *,
        bending_length: float,
        marker_a: float,
        marker_b: float,
        radius: float,
        band_length: float,
    ) -> Instrument: ...
    def markers(self, state: ArrayLike) -> _Floats: ...
    def jacobian(self, state: ArrayLike) -> _Floats: ...

@final
class Camera:
    def __new__(
        cls, *, fx: float, fy: float, cx: float, cy: float, distortion: _Vector8
    ) -> Camera: ...
    def project(self, points: ArrayLike) -> _Floats: ...
    def jacobian(self, point: ArrayLike) -> _Floats: ...

@final
class FeatureModel:
    def __new__(
        cls, instrument: Instrument, camera: Camera, *, translation: _Vector3, rotation: _Vector3
    ) -> FeatureModel: ...
    def predict(self, state: ArrayLike) -> tuple[_Floats, _Floats] | None: ...
    def predict_all(self, states: ArrayLike, unevenness: ArrayLike) -> tuple[_Floats, _Floats]: ...
    def bands(self, state: ArrayLike) -> tuple[_Band, _Band] | None: ...
    def nearest_state(
        self,
        state: ArrayLike,
        state_std: ArrayLike,
        features: ArrayLike,
        std: ArrayLike,
    ) -> tuple[_Floats, float] | None: ...

@final
class Hysteresis:
    def __new__(
        cls, *, half_width: ArrayLike, centre: ArrayLike, shared: float, radius: float
    ) -> Hysteresis: ...
    def run(self, commands: ArrayLike) -> _Floats: ...

@final
class StateEstimator:
    def __new__(cls, *, observable_deviation: _Vector3) -> StateEstimator: ...
    def estimate(
        self,
        predicted_state: ArrayLike,
        predicted_features: ArrayLike,
        interaction_matrix: ArrayLike,
        measured_features: ArrayLike,
    ) -> tuple[_Floats, _Flags, _Floats]: ...
    def run(
        self, model: FeatureModel, predicted_states: ArrayLike, measured_features: ArrayLike
    ) -> tuple[_Floats, _Flags]: ...

@final
class TipFilter:
    def __new__(
        cls, settings: Mapping[str, Any], *, expected_width: float, std: float
    ) -> TipFilter: ...
    def run(self, commands: ArrayLike, measured: ArrayLike) -> tuple[_Floats, _Floats, _Floats]: ...
    @property
    def gain(self) -> float: ...

_Update = tuple[
    str,
    _Floats,
    _Floats,
    _Floats,
    _Floats,
    _Flags,
    _Floats,
    _Floats,
    tuple[_Triggers, ...],
    _Floats,
    _Floats,
]

@final
class Reduction:
    def __new__(cls, settings: Mapping[str, Any], compensate: bool = True) -> Reduction: ...
    def step(
        self,
        reference: ArrayLike,
        time: float,
        stamp: float | None = None,
        limit: Callable[[_Floats, _Floats], ArrayLike] | None = None,
    ) -> _Floats: ...
    def run(self, references: ArrayLike, times: ArrayLike) -> _Floats: ...
    def on_features(
        self,
        features: ArrayLike | None,
        captured_at: float,
        covariance: ArrayLike | None = None,
        checksum: int | None = None,
    ) -> _Update: ...
    def on_reading(
        self,
        values: ArrayLike,
        covariance: ArrayLike,
        captured_at: float,
        predict: Callable[[_Floats], tuple[_Floats, _Floats] | None],
        point: int,
        sensor: int = 0,
    ) -> _Update: ...
    @property
    def supervision(self) -> tuple[str, list[str], list[str], float]: ...
    def engage(self) -> None: ...
    def acknowledge(self) -> None: ...
    def set_compensation(self, share: float) -> None: ...
    def raise_flag(self, name: str) -> None: ...
    def predicted_features(self, captured_at: float) -> _Floats | None: ...
    def predict_state(self, captured_at: float) -> tuple[_Floats, _Floats, _Floats] | None: ...
    @property
    def hysteresis(self) -> tuple[Any, ...]: ...
    @property
    def reference(self) -> _Floats: ...
    @property
    def predicted_state(self) -> _Floats: ...
    @property
    def delta_minus(self) -> _Floats: ...
    @property
    def delta_plus(self) -> _Floats: ...

# Image to markers: crates/vision.

@final
class PostureTable:
    def __new__(cls, model: FeatureModel, states: NDArray[np.float64]) -> Self: ...

@final
class MarkerDetector:
    def __new__(
        cls,
        model: FeatureModel,
        pixel_format: str,
        settings: Mapping[str, object],
        postures: PostureTable,
        states: NDArray[np.float64],
        std: NDArray[np.float64],
    ) -> Self: ...
    def detect(
        self,
        image: NDArray[np.uint8],
        prior: tuple[NDArray[np.float64], ...] | None,
    ) -> tuple[_Floats, _Floats, _Floats, tuple[str, str], list[_Region], int]: ...
    def regions_in(
        self, image: NDArray[np.uint8], windows: Sequence[tuple[int, int, int, int]]
    ) -> list[_Region]: ...
    def mask(self, image: NDArray[np.uint8]) -> NDArray[np.bool_]: ...

def label_regions(mask: NDArray[np.bool_]) -> list[_Region]: ...

# Models of hysteresis: tautscope.analysis.

def track_coefficients(
    rows: ArrayLike,
    travel: ArrayLike,
    measured: ArrayLike,
    *,
    mean: ArrayLike,
    variance: ArrayLike,
    growth: ArrayLike,
    noise: float,
) -> _Floats: ...
def move_along_curve(
    command: ArrayLike, positions: ArrayLike, curve: ArrayLike, *, start: float, rate: float
) -> _Floats: ...

# Images of the twin: crates/render.

@final
class Renderer:
    def __new__(
        cls,
        *,
        size: tuple[int, int],
        focal: tuple[float, float],
        centre: tuple[float, float],
        distortion: _Vector8,
        translation: _Vector3,
        rotation: _Vector3,
        diameter: float,
        bending_length: float,
        tip_length: float,
        markers: tuple[float, float],
        band_length: float,
        noise: float,
        seed: int,
    ) -> Renderer: ...
    def draw(
        self,
        background: NDArray[np.uint8],
        points: _Floats,
        directions: _Floats,
        sequence: int,
    ) -> tuple[NDArray[np.uint8], _Floats, _Floats]: ...
    def draw_scene(
        self, background: NDArray[np.uint8], points: _Floats, directions: _Floats
    ) -> tuple[NDArray[np.uint8], _Floats, _Floats, _Floats]: ...
    def draw_rows(
        self,
        background: NDArray[np.uint8],
        points: _Floats,
        directions: _Floats,
        image: NDArray[np.uint8],
        rows: Sequence[int],
    ) -> None: ...
    def add_noise(self, image: NDArray[np.uint8], sequence: int) -> None: ...
