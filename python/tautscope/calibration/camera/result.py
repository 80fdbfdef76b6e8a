"""A camera calibration as values of the configuration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from tautscope.calibration.camera.conversion import to_loop_model, widest_angle
from tautscope.calibration.camera.coverage import Coverage
from tautscope.calibration.camera.figure import CAPTION, coverage_figure
from tautscope.calibration.camera.intrinsics import CameraFit, Intrinsics
from tautscope.calibration.result import CalibrationResult


def camera_result(
    fit: CameraFit, coverage: Coverage, serial_numbers: Mapping[str, str]
) -> CalibrationResult:
    """The result of a fit; a fisheye lens is converted to the model of the loop.

    Raises:
        CalibrationError: The lens cannot be converted.
    """
    camera = fit.intrinsics
    std = dict(zip(("camera.fx", "camera.fy", "camera.cx", "camera.cy"), fit.std, strict=False))
    if camera.model == "pinhole":
        std |= {f"camera.distortion[{k}]": fit.std[4 + k] for k in range(len(camera.distortion))}
    values, conversion = camera_values(camera)
    notes = [f"{len(fit.views)} views, reprojection error {fit.residual:.3f} px"]
    if fit.left_out:
        notes.append(f"{fit.left_out} views left out: their errors are above 3 times the median")
    notes += conversion
    figures = ((coverage_figure(fit, coverage), CAPTION),)
    return CalibrationResult(
        "camera", values, std, fit.residual, serial_numbers, tuple(notes), figures
    )


def camera_values(camera: Intrinsics) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Values of the section ``camera``, and notes on what they do not represent.

    Raises:
        CalibrationError: The lens cannot be converted.
    """
    converted, error = to_loop_model(camera)
    (fx, fy), (cx, cy) = converted.focal, converted.centre
    width, height = camera.size
    values = {
        "camera.width": width,
        "camera.height": height,
        "camera.fx": fx,
        "camera.fy": fy,
        "camera.cx": cx,
        "camera.cy": cy,
        "camera.distortion": converted.distortion,
    }
    if camera.model == "pinhole":
        return values, ()
    note = (
        "The fisheye lens is converted to the pinhole with distortion of the loop: they differ by "
        f"{error:.2g} px at most, up to {math.degrees(widest_angle(camera)):.0f} degrees from the "
        "axis"
    )
    return values, (note,)
