"""Estimated values before and after, and the keys of the configuration that they change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.geometry.model import Model
from tautscope.calibration.geometry.parameters import PARAMETERS, Geometry
from tautscope.calibration.geometry.solver import Solution
from tautscope.config import Config

_POSE = "camera.camera_from_guide"


@dataclass(frozen=True, slots=True)
class Value:
    """An estimated value.

    Attributes:
        name: Parameter.
        before: Value of the configuration, in SI units; factors of focal lengths.
        after: Estimated value.
        prior_std: Standard deviation of `before` that the fit assumed.
        std: Standard deviation of `after`.
        shown: Factor to the shown unit.
        unit: Shown unit.
    """

    name: str
    before: float
    after: float
    prior_std: float
    std: float
    shown: float
    unit: str


def estimated_values(
    config: Config, model: Model, solution: Solution, active: NDArray[np.bool_]
) -> tuple[Value, ...]:
    """The estimated parameters; without a key of their own they are differences from 0."""
    instrument, camera, geometry = config.instrument, config.camera, model.geometry(solution.z)
    pose = camera.camera_from_guide
    known = {
        "instrument.bending_length": (instrument.bending_length, geometry.bending_length),
        "instrument.marker_a": (instrument.marker_a, geometry.marker_a),
        "instrument.marker_b": (instrument.marker_b, geometry.marker_b),
        "camera.focal": (1.0, geometry.fx / camera.fx),
        "camera.fy over fx": (1.0, geometry.fy / camera.fy * camera.fx / geometry.fx),
        "camera.cx": (camera.cx, geometry.cx),
        "camera.cy": (camera.cy, geometry.cy),
        "camera.distortion.k1": (camera.distortion[0], geometry.distortion[0]),
    }
    for k, axis in enumerate("xyz"):
        known[f"{_POSE}.translation.{axis}"] = pose.translation[k], geometry.translation[k]
        known[f"{_POSE}.rotation.{axis}"] = pose.rotation[k], geometry.rotation[k]
    std = np.sqrt(np.diag(solution.covariance))
    found = []
    for index in np.flatnonzero(active):
        parameter = PARAMETERS[index]
        before = camera.source.delay if parameter.name == "camera.source.delay" else 0.0
        after = before + float(solution.z[index] * model.prior_std[index])
        before, after = known.get(parameter.name, (before, after))
        # The length of the section is estimated as a factor.
        is_length = parameter.name == "instrument.bending_length"
        scale = geometry.bending_length if is_length else 1.0
        shown, unit = (1e3, "mm") if is_length else (parameter.shown, parameter.unit)
        prior = scale * model.prior_std[index]
        found.append(
            Value(
                parameter.name,
                float(before),
                float(after),
                float(prior),
                float(prior * std[index]),
                shown,
                unit,
            )
        )
    return tuple(found)


def changed_keys(config: Config, geometry: Geometry, values: tuple[Value, ...]) -> dict[str, Any]:
    """The keys of the configuration that were estimated, with their values."""
    names = {value.name: value for value in values}
    changes = geometry.values()
    if "camera.focal" not in names:
        del changes["camera.fx"], changes["camera.fy"]
    if "camera.cx" not in names:
        del changes["camera.cx"], changes["camera.cy"], changes["camera.distortion"]
    if changes["instrument.tip_length"] == config.instrument.tip_length:
        del changes["instrument.tip_length"]
    return changes | {"camera.source.delay": max(names["camera.source.delay"].after, 0.0)}


def key_stds(values: tuple[Value, ...], changes: dict[str, Any]) -> dict[str, float]:
    """Standard deviations by the key of the configuration, in its unit."""
    std = {value.name: value.std for value in values}
    found = {}
    for index, axis in enumerate("xyz"):
        for part in ("translation", "rotation"):
            found[f"{_POSE}.{part}[{index}]"] = std[f"{_POSE}.{part}.{axis}"]
    for key in ("instrument.bending_length", "instrument.marker_a", "camera.source.delay"):
        found[key] = std[key]
    # With a measured distance both bands move together.
    found["instrument.marker_b"] = std.get("instrument.marker_b", std["instrument.marker_a"])
    if "camera.focal" in std:
        ratio = std.get("camera.fy over fx", 0.0)
        found["camera.fx"] = changes["camera.fx"] * std["camera.focal"]
        found["camera.fy"] = changes["camera.fy"] * float(np.hypot(std["camera.focal"], ratio))
    if "camera.cx" in std:
        found |= {key: std[key] for key in ("camera.cx", "camera.cy")}
        found["camera.distortion[0]"] = std["camera.distortion.k1"]
    return found
