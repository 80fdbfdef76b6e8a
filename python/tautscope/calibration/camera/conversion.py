"""From OpenCV's camera models to that of the loop, Eq. (8): a pinhole with rational distortion."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.camera.intrinsics import Intrinsics
from tautscope.errors import CalibrationError

Floats = NDArray[np.float64]

WIDEST = np.radians(75.0)
"""Angle from the optical axis up to which a fisheye lens is converted: a pinhole has no 90 deg."""
_STEPS = 30


def to_loop_model(camera: Intrinsics) -> tuple[Intrinsics, float]:
    """The camera as a pinhole with k1, k2, p1, p2, k3, k4, k5, k6, and the error of the conversion.

    A pinhole keeps its coefficients, error 0. Of a fisheye lens, with theta_d(theta) = theta (1 +
    k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8) and r = tan(theta), the radial gain

        theta_d / r = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)

    is fitted over the angles that the image has, up to `WIDEST`.

    Returns:
        The camera, and the largest distance between the two models within those angles [px].

    Raises:
        CalibrationError: The lens maps angles to radii that do not increase, as none does.
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
    k1, k2, k3, k4, k5, k6 = _fit_gain(radii, bent / radii)
    distortion = tuple(map(float, (k1, k2, 0, 0, k3, k4, k5, k6)))
    converted = Intrinsics(camera.size, "pinhole", camera.focal, camera.centre, distortion)
    x = np.column_stack([radii, np.zeros_like(radii), np.ones_like(radii)])
    rays = np.vstack([x, x[:, [1, 0, 2]]])
    difference = camera.project(rays) - converted.project(rays)
    return converted, float(np.abs(difference).max())


def _bent_angle(camera: Intrinsics, angles: Floats) -> Floats:
    square, (k1, k2, k3, k4) = angles**2, camera.distortion
    bent: Floats = angles * (1 + square * (k1 + square * (k2 + square * (k3 + square * k4))))
    return bent


def widest_angle(camera: Intrinsics) -> float:
    """Largest angle from the optical axis in the image, at most `WIDEST`."""
    width, height = camera.size
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]], np.float64)
    (fx, fy), (cx, cy) = camera.focal, camera.centre
    radius = np.hypot((corners[:, 0] - cx) / fx, (corners[:, 1] - cy) / fy).max()
    angles = np.linspace(0, WIDEST, 2000)
    reached = _bent_angle(camera, angles) >= radius
    return float(angles[reached.argmax()]) if reached.any() else float(WIDEST)


def _fit_gain(radii: Floats, gain: Floats) -> Floats:
    """Numerator and denominator of the rational gain, by iterated linear least squares."""
    scale = float(radii.max())
    square = (radii / scale) ** 2
    powers = np.column_stack([square, square**2, square**3])
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
    units: Floats = scale ** -np.array([2.0, 4.0, 6.0, 2.0, 4.0, 6.0])
    return solution * units
