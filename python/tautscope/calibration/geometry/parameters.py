"""Parameters of the geometry calibration: their priors, and what they change in a configuration."""

import math
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import FieldError
from tautscope.loop.kinematics import Floats

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
        shown, unit: Factor to the shown unit, and its name.
    """

    name: str
    std: float
    shown: float
    unit: str


POSE = "camera.camera_from_guide"
PARAMETERS = (
    *(Parameter(f"{POSE}.translation.{axis}", 4e-3, 1e3, "mm") for axis in "xyz"),
    *(Parameter(f"{POSE}.rotation.{axis}", 0.07, 180 / np.pi, "deg") for axis in "xyz"),
    Parameter("instrument.bending_length", 0.1, 100, "%"),
    Parameter("instrument.marker_a", 0.8e-3, 1e3, "mm"),
    Parameter("instrument.marker_b", 0.8e-3, 1e3, "mm"),
    Parameter("camera.focal", 0.025, 100, "%"),
    Parameter("camera.fy over fx", 0.01, 100, "%"),
    Parameter("camera.cx", 3.0, 1, "px"),
    Parameter("camera.cy", 3.0, 1, "px"),
    Parameter("camera.distortion.k1", 0.02, 1, "1"),
    Parameter("unevenness", 0.3, 1, "1"),
    Parameter("unevenness over bending", 0.5, 1, "1/rad"),
    Parameter("camera.source.delay", 0.1, 1e3, "ms"),
    *(Parameter(f"lag {dof.label}", 1.0, 1, "log") for dof in Dof),
    *(Parameter(f"half width {dof.label}", 0.5, 1, "log") for dof in Dof),
    Parameter("elastic share insertion", 1.0, 1, "log"),
    Parameter("shared friction", 1.5, 1, "logit"),
    *(Parameter(f"gain {dof.label}", 0.2, 100, "%") for dof in Dof),
    Parameter("zero insertion", 1e-3, 1e3, "mm"),
    Parameter("zero rotation", 0.2, 180 / np.pi, "deg"),
    Parameter("zero bending", 0.15, 180 / np.pi, "deg"),
)
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
        fixed |= {"camera.fy over fx", "camera.cx", "camera.cy", "camera.distortion.k1"}
    if intrinsics == "none":
        fixed.add("camera.focal")
    return np.array([name not in fixed for name in NAMES])


def configured(config: Config, band_distance: float | None, difference: Floats) -> Config:
    """Camera, pose and instrument at a difference from a configuration.

    Nothing is checked: lengths and focal lengths stay positive.

    Args:
        config: The configuration.
        band_distance: Measured distance of the bands' centres [m], or None.
        difference: (parameters,) in SI units; relative for lengths and focal lengths (logarithm).
    """
    value = dict(zip(NAMES, difference.tolist(), strict=True))
    camera, instrument = config.camera, config.instrument
    pose, zero = camera.camera_from_guide, np.zeros(3)
    rotation = cv2.composeRT(np.array(pose.rotation), zero, difference[3:6].copy(), zero)[0]
    pose = replace(
        pose,
        translation=tuple((np.array(pose.translation) + difference[0:3]).tolist()),
        rotation=tuple(rotation.ravel().tolist()),
    )
    focal = math.exp(value["camera.focal"])
    k1, *others = camera.distortion
    camera = replace(
        camera,
        camera_from_guide=pose,
        fx=camera.fx * focal,
        fy=camera.fy * focal * math.exp(value["camera.fy over fx"]),
        cx=camera.cx + value["camera.cx"],
        cy=camera.cy + value["camera.cy"],
        distortion=(k1 + value["camera.distortion.k1"], *others),
    )
    band = instrument.band_length
    marker_a = max(instrument.marker_a + value["instrument.marker_a"], band / 2)
    marker_b = instrument.marker_b + value["instrument.marker_b"]
    if band_distance is not None:
        marker_b = marker_a + band_distance
    marker_b = max(marker_b, marker_a + band)
    instrument = replace(
        instrument,
        bending_length=instrument.bending_length * math.exp(value["instrument.bending_length"]),
        marker_a=marker_a,
        marker_b=marker_b,
        tip_length=max(instrument.tip_length, marker_b + band / 2),
    )
    return replace(config, camera=camera, instrument=instrument)
