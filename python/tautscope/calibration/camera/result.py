"""A camera calibration as values of the configuration, in the camera model of the loop, Eq. (8)."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tautscope.calibration.camera.coverage import COLUMNS, ROWS, Coverage
from tautscope.calibration.camera.intrinsics import LARGEST_RESIDUAL, CameraFit, Intrinsics
from tautscope.calibration.result import CalibrationResult
from tautscope.errors import CalibrationError
from tautscope.figure_style import BLUE
from tautscope.loop.kinematics import Floats

WIDEST = np.radians(75.0)
"""Angle from the optical axis up to which a fisheye lens is converted: a pinhole has no 90 deg."""
_STEPS = 30
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
    names = ("width", "height", "fx", "fy", "cx", "cy", "distortion")
    found = (*camera.size, *converted.focal, *converted.centre, converted.distortion)
    values = {f"camera.{name}": value for name, value in zip(names, found, strict=True)}
    if camera.model == "pinhole":
        return values, ()
    note = (
        "The fisheye lens is converted to the pinhole with distortion of the loop: they differ by "
        f"{error:.2g} px at most, up to {math.degrees(widest_angle(camera)):.0f} degrees from the "
        "axis"
    )
    return values, (note,)


def to_loop_model(camera: Intrinsics) -> tuple[Intrinsics, float]:
    """The camera as a pinhole with k1, k2, p1, p2, k3, k4, k5, k6, and the error of the conversion.

    A pinhole keeps its coefficients, error 0. Of a fisheye lens, with theta_d(theta) = theta (1 +
    k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8) and r = tan(theta), the radial gain

        theta_d / r = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)

    is fitted over the angles that the image has, up to `WIDEST`.

    Returns:
        The camera, and the largest distance between the two models within those angles [px].

    Raises:
        CalibrationError: The lens maps angles to radii that do not increase, as none does, or the
            error is above `LARGEST_RESIDUAL`.
    """
    if camera.model == "pinhole":
        padded = (*camera.distortion, *(0.0,) * (8 - len(camera.distortion)))
        return Intrinsics(camera.size, "pinhole", camera.focal, camera.centre, padded), 0.0
    angles = np.linspace(0, widest_angle(camera), 400)[1:]
    radii = np.tan(angles)
    bent = _bent_angle(camera, angles)
    if (np.diff(bent) <= 0).any():
        raise CalibrationError(
            "the fitted fisheye lens folds back within the image",
            "Show the board close to the corners of the image",
        )
    gain = _fit_gain(radii, bent / radii).tolist()
    distortion = (*gain[:2], 0.0, 0.0, *gain[2:])
    converted = Intrinsics(camera.size, "pinhole", camera.focal, camera.centre, distortion)
    x = np.column_stack([radii, np.zeros_like(radii), np.ones_like(radii)])
    rays = np.vstack([x, x[:, [1, 0, 2]]])
    error = float(np.abs(camera.project(rays) - converted.project(rays)).max())
    if not error <= LARGEST_RESIDUAL:
        raise CalibrationError(
            f"the fitted fisheye lens and the nearest pinhole of the loop differ by {error:.2g} px",
            f"At most {LARGEST_RESIDUAL:g} px: show the board close to the corners of the image, "
            "or try --model pinhole",
        )
    return converted, error


def _bent_angle(camera: Intrinsics, angles: Floats) -> Floats:
    square, (k1, k2, k3, k4) = angles**2, camera.distortion
    bent: Floats = angles * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
    return bent


def widest_angle(camera: Intrinsics) -> float:
    """Largest angle from the optical axis in the image, at most `WIDEST`."""
    corners = np.array([(0, 0), camera.size])  # the farthest has the farther u and v of them
    radius = np.hypot(*np.abs((corners - camera.centre) / camera.focal).max(axis=0))
    angles = np.linspace(0, WIDEST, 2000)
    reached = _bent_angle(camera, angles) >= radius
    return float(angles[reached.argmax()]) if reached.any() else float(WIDEST)


def _fit_gain(radii: Floats, gain: Floats) -> Floats:
    """Numerator and denominator of the rational gain, by iterated linear least squares."""
    scale = float(radii.max())
    square = (radii / scale) ** 2
    powers = square[:, None] ** [1, 2, 3]
    rows = np.hstack([powers, -gain[:, None] * powers])
    below = np.ones_like(gain)
    solution: Floats = np.zeros(6)
    for _ in range(_STEPS):
        weight = radii / below
        found, *_ = np.linalg.lstsq(rows * weight[:, None], (gain - 1) * weight, rcond=None)
        solution = np.asarray(found, np.float64)
        below = 1 + powers @ solution[3:]
        if (below <= 0).any():
            break
    return solution / scale ** np.array([2.0, 4.0, 6.0, 2.0, 4.0, 6.0])


def _figure(fit: CameraFit, coverage: Coverage) -> Figure:
    """The corners in the image, and the residuals."""
    width, height = fit.intrinsics.size
    figure = Figure(figsize=(9, 4.4), layout="constrained")
    image, scatter = figure.subplots(1, 2, width_ratios=(width / height, 1))
    corners = np.concatenate([view.pixels for view in fit.views])
    image.scatter(*corners.T, s=3, linewidths=0, color=BLUE)
    box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}
    for (row, column), count in np.ndenumerate(coverage.corners):
        place = (column + 0.5) * width / COLUMNS, (row + 0.5) * height / ROWS
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
