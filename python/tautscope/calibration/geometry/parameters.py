"""Parameters of the geometry calibration: their priors, and what they change in a configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from tautscope import _core
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import FieldError

Floats = NDArray[np.float64]
Intrinsics = Literal["none", "focal", "all"]
INTRINSICS: tuple[Intrinsics, ...] = ("none", "focal", "all")
"""Which intrinsic parameters are estimated: none; one factor of both focal lengths; focal lengths,
principal point and k1."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A parameter of the model, as a difference from the configuration.

    Attributes:
        name: Unique; dotted as in TOML where there is such a key.
        std: Prior standard deviation of the difference, in SI units; `prior_std` has the exception.
        shown: Factor to the shown unit.
        unit: Shown unit.
    """

    name: str
    std: float
    shown: float
    unit: str


_POSE = "camera.camera_from_guide"
_TRANSLATION = tuple(Parameter(f"{_POSE}.translation.{axis}", 4e-3, 1e3, "mm") for axis in "xyz")
_ROTATION = tuple(Parameter(f"{_POSE}.rotation.{axis}", 0.07, 180 / np.pi, "deg") for axis in "xyz")
_LENGTHS = (
    Parameter("instrument.bending_length", 0.1, 100, "%"),
    Parameter("instrument.marker_a", 0.8e-3, 1e3, "mm"),
    Parameter("instrument.marker_b", 0.8e-3, 1e3, "mm"),
)
_CAMERA = (
    Parameter("camera.focal", 0.025, 100, "%"),
    Parameter("camera.fy over fx", 0.01, 100, "%"),
    Parameter("camera.cx", 3.0, 1, "px"),
    Parameter("camera.cy", 3.0, 1, "px"),
    Parameter("camera.distortion.k1", 0.02, 1, "1"),
)
_SHAPE = (
    Parameter("unevenness", 0.3, 1, "1"),
    Parameter("unevenness over bending", 0.5, 1, "1/rad"),
)
_TIMES = (
    Parameter("camera.source.delay", 0.1, 1e3, "ms"),
    *(Parameter(f"lag {dof.label}", 1.0, 1, "log") for dof in Dof),
)
_PLAY = (
    *(Parameter(f"half width {dof.label}", 0.5, 1, "log") for dof in Dof),
    Parameter("elastic share insertion", 1.0, 1, "log"),
    Parameter("shared friction", 1.5, 1, "logit"),
    *(Parameter(f"gain {dof.label}", 0.2, 100, "%") for dof in Dof),
    Parameter("zero insertion", 1e-3, 1e3, "mm"),
    Parameter("zero rotation", 0.2, 180 / np.pi, "deg"),
    Parameter("zero bending", 0.15, 180 / np.pi, "deg"),
)
PARAMETERS = (*_TRANSLATION, *_ROTATION, *_LENGTHS, *_CAMERA, *_SHAPE, *_TIMES, *_PLAY)
NAMES = tuple(parameter.name for parameter in PARAMETERS)
INDEX = {name: index for index, name in enumerate(NAMES)}
IMAGE = slice(0, INDEX["unevenness over bending"] + 1)
"""The parameters that the features depend on; the others are of the motion of the tip."""
RESULTS = slice(0, INDEX["camera.source.delay"] + 1)
"""The parameters that are results; the others are those of this motion alone."""
TYPICAL_ELASTIC_SHARE = 0.07
"""Median of the prior of the share of insertion's travel that the tip follows within its play."""
LARGEST_ELASTIC_SHARE = 0.9
TYPICAL_LAG = 0.03
"""Median of the prior of the lag of the tip behind the motors [s]."""


SCALE_STD = 0.02
"""Prior standard deviation of the gain of insertion, where it is the scale of all lengths: what the
play does not describe acts like a gain of 1 to 2 % (decision 0049)."""
SECTION_SHAPE_STD = (0.03, 0.05)
"""Standard deviation of the section's length from a shape that one unevenness does not describe, as
a share of it: at the least, and per unevenness over bending [rad]. No residual shows it (decision
0049)."""


def prior_std(*, by_band_distance: bool) -> Floats:
    """Prior standard deviations (parameters,) in SI units."""
    std = np.array([parameter.std for parameter in PARAMETERS])
    if not by_band_distance:
        std[INDEX["gain insertion"]] = SCALE_STD
    return std


def estimated(intrinsics: Intrinsics, *, by_band_distance: bool) -> NDArray[np.bool_]:
    """Which parameters are estimated, with the three free directions fixed.

    The zeros of insertion and rotation are those of the drives. The metric scale is that of the
    insertion drive, to `SCALE_STD`, or of the measured distance of the bands; with the latter, the
    difference of `marker_b` is that of `marker_a`.

    Raises:
        FieldError: `intrinsics` is none of `INTRINSICS`.
    """
    if intrinsics not in INTRINSICS:
        raise FieldError("intrinsics", intrinsics, ", ".join(INTRINSICS))
    fixed = {"zero insertion", "zero rotation"}
    if by_band_distance:
        fixed.add("instrument.marker_b")
    if intrinsics != "all":
        fixed |= {parameter.name for parameter in _CAMERA[1:]}
    if intrinsics == "none":
        fixed.add("camera.focal")
    return np.array([name not in fixed for name in NAMES])


class Geometry:
    """Camera, pose and instrument at a difference from a configuration.

    Args:
        config: The configuration.
        band_distance: Measured distance of the bands' centres [m], or None.
        difference: (parameters,) in SI units; relative for lengths and focal lengths (logarithm).
    """

    def __init__(self, config: Config, band_distance: float | None, difference: Floats) -> None:
        value = dict(zip(NAMES, difference.tolist(), strict=True))
        camera, instrument = config.camera, config.instrument
        pose = camera.camera_from_guide
        self.translation = _vector(np.array(pose.translation) + difference[0:3])
        self.rotation = _vector(compose(difference[3:6], pose.rotation))
        self.bending_length = instrument.bending_length * np.exp(value["instrument.bending_length"])
        half = instrument.band_length / 2
        self.marker_a = max(instrument.marker_a + value["instrument.marker_a"], half)
        self.marker_b = instrument.marker_b + value["instrument.marker_b"]
        if band_distance is not None:
            self.marker_b = self.marker_a + band_distance
        self.marker_b = max(self.marker_b, self.marker_a + 2 * half)
        self.fx = camera.fx * np.exp(value["camera.focal"])
        self.fy = camera.fy * np.exp(value["camera.focal"] + value["camera.fy over fx"])
        self.cx, self.cy = camera.cx + value["camera.cx"], camera.cy + value["camera.cy"]
        k1, *others = camera.distortion
        self.distortion = (k1 + value["camera.distortion.k1"], *others)
        self._config = config

    def feature_model(self) -> _core.FeatureModel:
        """The feature model of the core, Eqs. (9)-(11)."""
        instrument = self._config.instrument
        return _core.FeatureModel(
            _core.Instrument(
                bending_length=self.bending_length,
                marker_a=self.marker_a,
                marker_b=self.marker_b,
                radius=instrument.diameter / 2,
                band_length=instrument.band_length,
            ),
            _core.Camera(
                fx=self.fx, fy=self.fy, cx=self.cx, cy=self.cy, distortion=self.distortion
            ),
            translation=self.translation,
            rotation=self.rotation,
        )

    def values(self) -> dict[str, Any]:
        """The values by dotted path, as for `Config.replace`."""
        instrument = self._config.instrument
        end = self.marker_b + instrument.band_length / 2
        return {
            f"{_POSE}.translation": list(self.translation),
            f"{_POSE}.rotation": list(self.rotation),
            "camera.fx": float(self.fx),
            "camera.fy": float(self.fy),
            "camera.cx": float(self.cx),
            "camera.cy": float(self.cy),
            "camera.distortion": [float(value) for value in self.distortion],
            "instrument.bending_length": float(self.bending_length),
            "instrument.marker_a": float(self.marker_a),
            "instrument.marker_b": float(self.marker_b),
            "instrument.tip_length": float(max(instrument.tip_length, end)),
        }


def matrix(rotation: Sequence[float] | Floats) -> Floats:
    """Rotation matrix (3, 3) of a rotation vector (3,), axis times angle [rad] (Rodrigues)."""
    vector = np.asarray(rotation, dtype=np.float64)
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    half = np.sinc(angle / 2 / np.pi)
    rotated: Floats = np.eye(3) + np.sinc(angle / np.pi) * cross + half**2 / 2 * cross @ cross
    return rotated


def compose(first: Floats, second: Sequence[float]) -> Floats:
    """Rotation vector (3,) of the rotation `second`, then `first`; both rotation vectors."""
    a, b = _quaternion(first), _quaternion(np.asarray(second, dtype=np.float64))
    scalar = a[0] * b[0] - a[1:] @ b[1:]
    vector = a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    if scalar < 0:
        scalar, vector = -scalar, -vector
    length = float(np.linalg.norm(vector))
    angle = 2 * np.arctan2(length, scalar)
    return np.asarray(vector * (angle / length if length > 0 else 2.0))


def _quaternion(rotation: Floats) -> Floats:
    angle = float(np.linalg.norm(rotation))
    return np.concatenate([[np.cos(angle / 2)], np.sinc(angle / 2 / np.pi) / 2 * rotation])


def _vector(values: Floats) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return x, y, z
