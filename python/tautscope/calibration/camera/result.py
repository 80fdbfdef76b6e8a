"""A camera calibration as values of the configuration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tautscope.calibration.camera.conversion import to_loop_model, widest_angle
from tautscope.calibration.camera.coverage import COLUMNS, ROWS, Coverage
from tautscope.calibration.camera.intrinsics import CameraFit, Intrinsics
from tautscope.calibration.result import CalibrationResult
from tautscope.figure_style import BLUE

_CAPTION = (
    "Left: all corners of the board that were used, in the image, with the cells that had to be "
    "covered. Right: measured minus projected corners, with their root mean square."
)


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
    figures = ((_figure(fit, coverage), _CAPTION),)
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


def _figure(fit: CameraFit, coverage: Coverage) -> Figure:
    """The corners in the image, and the residuals."""
    width, height = fit.intrinsics.size
    figure = Figure(figsize=(9, 4.4), layout="constrained")
    image, scatter = figure.subplots(1, 2, width_ratios=(width / height, 1))
    corners = np.concatenate([view.pixels for view in fit.views])
    image.scatter(*corners.T, s=3, linewidths=0, color=BLUE)
    for row in range(ROWS):
        for column in range(COLUMNS):
            place = (column + 0.5) * width / COLUMNS, (row + 0.5) * height / ROWS
            count = int(coverage.corners[row, column])
            box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}
            image.text(*place, str(count), ha="center", va="center", fontsize=8, bbox=box)
    for k in range(1, COLUMNS):
        image.axvline(k * width / COLUMNS, color="0.7", linewidth=0.6)
    for k in range(1, ROWS):
        image.axhline(k * height / ROWS, color="0.7", linewidth=0.6)
    image.set(xlim=(0, width), ylim=(height, 0), xlabel="u [px]", ylabel="v [px]", aspect="equal")
    image.set_title(f"{len(corners)} corners in {len(fit.views)} views", fontsize=10)
    scatter.scatter(*fit.residuals.T, s=3, linewidths=0, color=BLUE)
    scatter.axhline(0, color="0.7", linewidth=0.6)
    scatter.axvline(0, color="0.7", linewidth=0.6)
    reach = 1.05 * float(np.abs(fit.residuals).max())
    scatter.set(xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal")
    scatter.set(xlabel="residual in u [px]", ylabel="residual in v [px]")
    scatter.set_title(f"reprojection error {fit.residual:.3f} px", fontsize=10)
    return figure
