"""Fit of the geometry to a calibration record."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.geometry.checks import LARGEST_RESIDUAL, check_record, find_doubts
from tautscope.calibration.geometry.model import FEATURE_STD, TIP_STD, Data, Model
from tautscope.calibration.geometry.parameters import (
    INDEX,
    PARAMETERS,
    PRIOR_STD,
    Geometry,
    Intrinsics,
    estimated,
)
from tautscope.calibration.geometry.recording import Recording, generic
from tautscope.calibration.geometry.solver import Solution, solve
from tautscope.config import Config
from tautscope.errors import FieldError
from tautscope.loop.state_prediction import StatePrediction
from tautscope.loop.vision import MarkerDetector

Floats = NDArray[np.float64]
DETECTIONS = 2
"""How often the bands are searched again with the geometry found so far."""
FEATURE_STD_RANGE = (0.15, 1.0)
"""Standard deviation of a feature that the residuals may lead to [px]."""


@dataclass(frozen=True, slots=True)
class Value:
    """An estimated value.

    Attributes:
        name: Parameter.
        before: Value of the configuration, in SI units.
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


@dataclass(frozen=True, eq=False)
class GeometryFit:
    """Result of the geometry calibration.

    Attributes:
        config: The configuration with the estimated geometry and delay.
        std: Parameter -> standard deviation in SI units: `camera.camera_from_guide.translation.x`
            [m], `.rotation.x` [rad, about the camera's axes], `instrument.bending_length` [m],
            `camera.focal` [1], `camera.source.delay` [s], ...
        residual_px: Root mean square of the residuals [px], of the images that are explained.
        warnings: What the user has to know; empty in the normal case.
        is_plausible: Whether the model explains the record; if not, do not use `config`.
        values: Estimated values, before and after.
        found_share: Share of the images in which both bands were found at last.
        recording: The record, with the features of the last detection.
        states: (images, 3) most probable tip [m, rad, rad]; NaN without both bands.
        residuals: (images, 4) measured minus predicted features [px]; NaN likewise.
        expected: (images, 3) tip that the motors let expect [m, rad, rad]; NaN likewise.
    """

    config: Config
    std: dict[str, float]
    residual_px: float
    warnings: tuple[str, ...]
    is_plausible: bool
    values: tuple[Value, ...]
    found_share: float
    recording: Recording
    states: Floats
    residuals: Floats
    expected: Floats


def fit(
    recording: Recording,
    config: Config,
    *,
    intrinsics: Intrinsics = "focal",
    band_distance: float | None = None,
) -> GeometryFit:
    """Estimate pose, lengths, intrinsics and delay from a calibration motion.

    The parameters are estimated together with the state of every image; hysteresis is a loose
    expectation of it. Images, if there are any, are searched again with the geometry found.
    Decision 0041 has the equations, docs/calibration.md what is determined.

    Three directions are free and fixed by convention: insertion and rotation are 0 where the
    drives are, and lengths are those of the insertion drive or of `band_distance`.

    Args:
        recording: From `sweep`, or of your own motors and features.
        config: The configuration with a rough geometry, within about 5 mm and 5 deg.
        intrinsics: ``none``, ``focal`` (one factor of both focal lengths) or ``all``.
        band_distance: Measured distance of the bands' centres [m], in place of the drive's scale.

    Raises:
        RecordError: The record does not determine the geometry: too few bands, over-exposed images,
            too little motion.
        FieldError: An option has a value that is not allowed.
    """
    if band_distance is not None and not (
        np.isfinite(band_distance) and band_distance > config.instrument.band_length
    ):
        raise FieldError("band_distance", band_distance, "a length above instrument.band_length")
    active = estimated(intrinsics, by_band_distance=band_distance is not None)
    check_record(recording, config)
    model = _model(recording, config, band_distance)
    solution = solve(model, active)
    for _ in range(DETECTIONS if recording.patches else 0):
        recording = _detect_again(recording, config, model, solution, band_distance)
        check_record(recording, config)
        model = _model(recording, config, band_distance)
        solution = solve(model, active, solution.z)
    # Of the four features of an image, the state takes up three.
    feature_std = float(
        np.clip(np.nan_to_num(2 * _rms(solution.residuals), nan=1.0), *FEATURE_STD_RANGE)
    )
    model = _model(recording, config, band_distance, feature_std)
    solution = solve(model, active, solution.z)
    free = solve(model, active, solution.z, free_states=True)
    return _result(recording, config, model, solution, free, active)


def _model(
    recording: Recording,
    config: Config,
    band_distance: float | None,
    feature_std: float = FEATURE_STD,
) -> Model:
    found = recording.found
    data = Data(
        recording.time, recording.motors, recording.captured_at[found], recording.features[found]
    )
    return Model(config, data, band_distance, feature_std)


def _detect_again(
    recording: Recording,
    config: Config,
    model: Model,
    solution: Solution,
    band_distance: float | None,
) -> Recording:
    """The record with the bands searched near the fitted or expected tip of every image."""
    found, everywhere = (
        recording.found,
        Data(recording.time, recording.motors, recording.captured_at, recording.features),
    )
    tips = Model(config, everywhere, band_distance).expected(solution.z)[:, :3]
    tips[found] = solution.states[:, :3]
    fitted = config.replace(**model.geometry(solution.z).values())
    detector, std = MarkerDetector(fitted), TIP_STD * np.array(config.safety.width_limit)
    features, reasons = np.full_like(recording.features, np.nan), dict[str, int]()
    for index, (patch, tip) in enumerate(zip(recording.patches, tips, strict=True)):
        detection = detector.detect(patch.image(config.camera), None, StatePrediction(tip, std))
        if detection.valid:
            features[index] = detection.features
        else:
            reason = generic(detection.reason)
            reasons[reason] = reasons.get(reason, 0) + 1
    return replace(recording, features=features, reasons=reasons)


def _result(
    recording: Recording,
    config: Config,
    model: Model,
    solution: Solution,
    free: Solution,
    active: NDArray[np.bool_],
) -> GeometryFit:
    geometry = model.geometry(solution.z)
    changes = geometry.values()
    delay = config.camera.source.delay + float(
        solution.z[INDEX["camera.source.delay"]] * PRIOR_STD[INDEX["camera.source.delay"]]
    )
    changes["camera.source.delay"] = max(delay, 0.0)
    doubts, warnings = find_doubts(model, solution, free, active)
    if delay < 0:
        warnings.append(
            f"Images are stamped {-delay * 1e3:.0f} ms before the motors' clock: "
            "camera.source.delay is set to 0, which cannot express it"
        )
    values = _values(config, geometry, delay, solution, active)

    def per_image(table: Floats) -> Floats:
        whole = np.full((len(recording.captured_at), table.shape[1]), np.nan)
        whole[recording.found] = table
        return whole

    return GeometryFit(
        config=config.replace(**changes),
        std={value.name: value.std for value in values},
        residual_px=_rms(solution.residuals),
        warnings=(*doubts, *warnings),
        is_plausible=not doubts,
        values=values,
        found_share=float(recording.found.mean()),
        recording=recording,
        states=per_image(solution.states[:, :3]),
        residuals=per_image(solution.residuals),
        expected=per_image(solution.expected[:, :3]),
    )


def _rms(residuals: Floats) -> float:
    """Root mean square of the residuals of explained images [px]; NaN if there is none."""
    explained = residuals[np.abs(residuals).max(axis=1) < LARGEST_RESIDUAL]
    return float(np.sqrt(np.mean(explained**2))) if len(explained) else float("nan")


def _values(
    config: Config,
    geometry: Geometry,
    delay: float,
    solution: Solution,
    active: NDArray[np.bool_],
) -> tuple[Value, ...]:
    """The estimated parameters; lengths in m, focal lengths as a factor."""
    instrument, camera = config.instrument, config.camera
    before = {
        "instrument.bending_length": instrument.bending_length,
        "instrument.marker_a": instrument.marker_a,
        "instrument.marker_b": instrument.marker_b,
        "camera.cx": camera.cx,
        "camera.cy": camera.cy,
        "camera.distortion.k1": camera.distortion[0],
        "camera.focal": 1.0,
        "camera.fy over fx": 1.0,
        "camera.source.delay": camera.source.delay,
    }
    after = {
        "instrument.bending_length": geometry.bending_length,
        "instrument.marker_a": geometry.marker_a,
        "instrument.marker_b": geometry.marker_b,
        "camera.source.delay": delay,
    }
    for axis, old, new in zip(
        "xyz", camera.camera_from_guide.translation, geometry.translation, strict=True
    ):
        name = f"camera.camera_from_guide.translation.{axis}"
        before[name], after[name] = old, new
    for axis, old, new in zip(
        "xyz", camera.camera_from_guide.rotation, geometry.rotation, strict=True
    ):
        name = f"camera.camera_from_guide.rotation.{axis}"
        before[name], after[name] = old, new
    std = np.sqrt(np.diag(solution.covariance))
    found = []
    for index in np.flatnonzero(active):
        parameter = PARAMETERS[index]
        old = before.get(parameter.name, 0.0)
        difference = float(solution.z[index] * parameter.std)
        scale, shown, unit = 1.0, parameter.shown, parameter.unit
        if parameter.name == "instrument.bending_length":
            scale, shown, unit = geometry.bending_length, 1e3, "mm"
        found.append(
            Value(
                parameter.name,
                float(old),
                float(after.get(parameter.name, old + difference)),
                float(scale * parameter.std),
                float(scale * std[index] * parameter.std),
                shown,
                unit,
            )
        )
    return tuple(found)
