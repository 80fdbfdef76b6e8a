"""Fit of the geometry to a calibration record."""

from collections import Counter
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.geometry import checks
from tautscope.calibration.geometry.checks import check_record
from tautscope.calibration.geometry.model import TIP_STD, Model
from tautscope.calibration.geometry.parameters import Intrinsics, estimated
from tautscope.calibration.geometry.recording import Recording, generic
from tautscope.calibration.geometry.solver import Solution, solve
from tautscope.calibration.geometry.values import (
    DELAY,
    Value,
    changes_and_stds,
    estimated_values,
)
from tautscope.config import Config
from tautscope.errors import FieldError
from tautscope.loop.kinematics import Floats
from tautscope.loop.signal_checks import as_numbers
from tautscope.loop.state_prediction import StatePrediction
from tautscope.loop.vision import MarkerDetector

DETECTIONS = 2
"""How often the bands are searched again with the geometry found so far."""


@dataclass(frozen=True, eq=False)
class GeometryFit:
    """Result of the geometry calibration.

    Attributes:
        config: The configuration with the estimated geometry and delay.
        changes: Dotted key -> value of `config`, for `Config.replace`: what was estimated.
        std: Key -> standard deviation in the unit of the key:
            `camera.camera_from_guide.translation[0]` [m], `.rotation[0]` [rad, about the camera's
            axes], `instrument.bending_length` [m], `camera.fx` [px], `camera.source.delay` [s], ...
        pose_covariance: (6, 6) of translation [m] and rotation about the camera's axes [rad].
        residual_px: Root mean square of the residuals [px], of the images that are explained.
        warnings: What the user has to know; empty in the normal case.
        is_plausible: Whether the model explains the record; if not, do not use `config`.
        values: Estimated values, before and after.
        recording: The record, with the features of the last detection.
        states: (images, 3) most probable tip [m, rad, rad]; NaN without both bands.
        residuals: (images, 4) measured minus predicted features [px]; NaN likewise.
        expected: (images, 3) tip that the motors let expect [m, rad, rad]; NaN likewise.
    """

    config: Config
    changes: dict[str, Any]
    std: dict[str, float]
    pose_covariance: Floats
    residual_px: float
    warnings: tuple[str, ...]
    is_plausible: bool
    values: tuple[Value, ...]
    recording: Recording
    states: Floats
    residuals: Floats
    expected: Floats

    @property
    def found_share(self) -> float:
        """Share of the images in which both bands were found at last."""
        return float(self.recording.found.mean())


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
        config: The configuration with a rough geometry, within about 5 mm and 5 deg; its
            `camera.source.delay` has been subtracted from the stamps.
        intrinsics: ``none``, ``focal`` (one factor of both focal lengths) or ``all``.
        band_distance: Measured distance of the bands' centres [m], in place of the drive's scale.

    Raises:
        RecordError: The record does not determine the geometry: too few bands, over-exposed images,
            too little motion.
        FieldError: An option has a value that is not allowed.
    """
    if band_distance is not None:
        allowed = "a length above instrument.band_length"
        distance = as_numbers("band_distance", band_distance, allowed)
        if distance.shape or not config.instrument.band_length < distance < np.inf:
            raise FieldError("band_distance", band_distance, allowed)
    active = estimated(intrinsics, by_band_distance=band_distance is not None)
    check_record(recording, config)
    model = Model(config, recording.with_bands(), band_distance)
    solution = solve(model, active)
    for _ in range(DETECTIONS if recording.patches else 0):
        recording = _detect_again(recording, model, solution)
        check_record(recording, config)
        model = Model(config, recording.with_bands(), band_distance)
        solution = solve(model, active, solution.z)
    free = solve(model, active, solution.z, free_states=True)
    return _result(recording, model, solution, free, active)


def _detect_again(recording: Recording, model: Model, solution: Solution) -> Recording:
    """The record with the bands searched near the fitted or expected tip of every image."""
    config = model.config
    tips = Model(config, recording, model.band_distance).expected(solution.z)[:, :3]
    tips[recording.found] = solution.states[:, :3]
    detector = MarkerDetector(model.configured(solution.z))
    std = TIP_STD * np.array(config.safety.width_limit)
    features, reasons = np.full_like(recording.features, np.nan), Counter[str]()
    for index, (patch, tip) in enumerate(zip(recording.patches, tips, strict=True)):
        detection = detector.detect(patch.image(config.camera), None, StatePrediction(tip, std))
        if detection.valid:
            features[index] = detection.features
        else:
            reasons[generic(detection.reason)] += 1
    return replace(recording, features=features, reasons=reasons)


def _result(
    recording: Recording,
    model: Model,
    solution: Solution,
    free: Solution,
    active: NDArray[np.bool_],
) -> GeometryFit:
    doubts, warnings = checks.find_doubts(model, solution, free, active)
    if short := checks.shortness(recording):
        warnings.append(short)
    values = estimated_values(model, solution, active)
    changes, stds = changes_and_stds(model.config, model.configured(solution.z), values)
    delay = next(value for value in values if value.name == DELAY)
    if delay.after < -2 * delay.std:
        warnings.append(
            f"Images are stamped {-delay.after * 1e3:.0f} ms before the motors' clock: "
            "camera.source.delay is set to 0, which cannot express it"
        )
    explained = solution.residuals[np.abs(solution.residuals).max(axis=1) < checks.LARGEST_RESIDUAL]

    def per_image(table: Floats) -> Floats:
        whole = np.full((len(recording.captured_at), table.shape[1]), np.nan)
        whole[recording.found] = table
        return whole

    return GeometryFit(
        config=model.config.replace(**changes),
        changes=changes,
        std=stds,
        pose_covariance=(solution.covariance * np.outer(model.prior_std, model.prior_std))[:6, :6],
        residual_px=float(np.sqrt(np.mean(explained**2))) if len(explained) else float("nan"),
        warnings=(*doubts, *warnings),
        is_plausible=not doubts,
        values=values,
        recording=recording,
        states=per_image(solution.states[:, :3]),
        residuals=per_image(solution.residuals),
        expected=per_image(solution.expected[:, :3]),
    )
