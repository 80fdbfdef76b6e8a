"""Estimated values before and after, and the keys of the configuration that they change."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.geometry.model import Model
from tautscope.calibration.geometry.parameters import PARAMETERS, POSE
from tautscope.calibration.geometry.solver import Solution
from tautscope.config import Config

DELAY = "camera.source.delay"
_LENGTHS = ("bending_length", "marker_a", "marker_b")


@dataclass(frozen=True, slots=True)
class Value:
    """An estimated value.

    Attributes:
        name: Parameter.
        before, prior_std: Value of the configuration, in SI units (factors of focal lengths), and
            its standard deviation that the fit assumed.
        after, std: Estimated value, and its standard deviation.
        shown, unit: Factor to the shown unit, and its name.
    """

    name: str
    before: float
    after: float
    prior_std: float
    std: float
    shown: float
    unit: str


def estimated_values(
    model: Model, solution: Solution, active: NDArray[np.bool_]
) -> tuple[Value, ...]:
    """The estimated parameters; without a key of their own they are differences from 0."""
    config = model.config
    start, end = _values(config, config), _values(model.configured(solution.z), config)
    start[DELAY] = config.camera.source.delay  # already subtracted from the stamps
    difference = solution.z * model.prior_std
    std = np.sqrt(np.diag(solution.covariance))
    found = []
    for index in np.flatnonzero(active):
        parameter = PARAMETERS[index]
        before = start.get(parameter.name, 0.0)
        after = end.get(parameter.name, before + float(difference[index]))
        prior, shown, unit = float(model.prior_std[index]), parameter.shown, parameter.unit
        if parameter.name == "instrument.bending_length":  # estimated as a factor
            prior, shown, unit = prior * after, 1e3, "mm"
        own_std = prior * float(std[index])
        found.append(Value(parameter.name, before, after, prior, own_std, shown, unit))
    return tuple(found)


def _values(config: Config, before: Config) -> dict[str, float]:
    """Values of parameters in a configuration; focal lengths are factors to those before."""
    camera, old, pose = config.camera, before.camera, config.camera.camera_from_guide
    return {
        **{f"instrument.{name}": getattr(config.instrument, name) for name in _LENGTHS},
        "camera.focal": camera.fx / old.fx,
        "camera.fy over fx": camera.fy / old.fy * old.fx / camera.fx,
        "camera.cx": camera.cx,
        "camera.cy": camera.cy,
        "camera.distortion.k1": camera.distortion[0],
        **{f"{POSE}.translation.{a}": v for a, v in zip("xyz", pose.translation, strict=True)},
        **{f"{POSE}.rotation.{a}": v for a, v in zip("xyz", pose.rotation, strict=True)},
    }


def changes_and_stds(
    config: Config, fitted: Config, values: tuple[Value, ...]
) -> tuple[dict[str, Any], dict[str, float]]:
    """The keys that were estimated with their values, and standard deviations in their units."""
    known = {value.name: value for value in values}
    std = {value.name: value.std for value in values}
    camera, instrument, pose = fitted.camera, fitted.instrument, fitted.camera.camera_from_guide
    changes: dict[str, Any] = {
        f"{POSE}.translation": list(pose.translation),
        f"{POSE}.rotation": list(pose.rotation),
        DELAY: max(known[DELAY].after, 0.0),
    }
    changes |= {f"instrument.{key}": getattr(instrument, key) for key in _LENGTHS}
    # With a measured distance both bands move together.
    std.setdefault("instrument.marker_b", std["instrument.marker_a"])
    stds = {key: std[key] for key in changes if key in std}
    for part in ("translation", "rotation"):
        stds |= {f"{POSE}.{part}[{k}]": std[f"{POSE}.{part}.{a}"] for k, a in enumerate("xyz")}
    if "camera.focal" in known:
        changes |= {"camera.fx": camera.fx, "camera.fy": camera.fy}
        ratio = std.get("camera.fy over fx", 0.0)
        stds["camera.fx"] = camera.fx * std["camera.focal"]
        stds["camera.fy"] = camera.fy * math.hypot(std["camera.focal"], ratio)
    if "camera.cx" in known:
        changes |= {"camera.cx": camera.cx, "camera.cy": camera.cy}
        changes["camera.distortion"] = list(camera.distortion)
        stds |= {key: std[key] for key in ("camera.cx", "camera.cy")}
        stds["camera.distortion[0]"] = std["camera.distortion.k1"]
    if instrument.tip_length != config.instrument.tip_length:
        changes["instrument.tip_length"] = instrument.tip_length
    return changes, stds
