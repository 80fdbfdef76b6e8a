"""Intrinsics of a camera from views of a board, with standard deviations."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from tautscope.calibration.camera.board import View
from tautscope.errors import CalibrationError
from tautscope.loop.kinematics import Floats

Model = Literal["pinhole", "fisheye"]

OUTLIER = 3.0
"""A view whose error is larger than this multiple of the median is left out."""
LARGEST_RESIDUAL = 1.0
"""A fit with a larger reprojection error is refused [px]."""
_DISTORTION = {"pinhole": 5, "fisheye": 4}
"""Number of distortion coefficients: k1, k2, p1, p2, k3; k1 to k4."""


@dataclass(frozen=True)
class Intrinsics:
    """A camera model of OpenCV.

    Attributes:
        size: Width and height of the images [px].
        model: ``pinhole`` with k1, k2, p1, p2, k3[, k4, k5, k6] (ROS: plumb_bob,
            rational_polynomial), or ``fisheye`` with k1 to k4 (ROS: equidistant).
        focal: fx, fy [px].
        centre: cx, cy [px].
        distortion: The coefficients.
    """

    size: tuple[int, int]
    model: Model
    focal: tuple[float, float]
    centre: tuple[float, float]
    distortion: tuple[float, ...]

    @property
    def matrix(self) -> Floats:
        """The camera matrix (3, 3)."""
        (fx, fy), (cx, cy) = self.focal, self.centre
        return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])

    def project(self, points: Floats) -> Floats:
        """Project points (n, 3) in the camera's frame: (n, 2) [px]."""
        pixels, _ = _project(self, np.asarray(points, np.float64), np.zeros(3), np.zeros(3))
        return pixels


@dataclass(frozen=True, eq=False)
class CameraFit:
    """The result of `fit_intrinsics`.

    Attributes:
        intrinsics: The camera.
        std: Standard deviations of fx, fy, cx, cy [px] and of the distortion, from the Jacobian of
            the reprojection and the residuals::

                Sigma = s^2 (J^T J)^-1,    s^2 = |r|^2 / (residuals - parameters)

            with the poses of the views eliminated. Wrong (too small) when the board is not flat,
            its squares differ from the print, or the errors of a view are alike.
        residual, errors: Root mean square of the distances from measured to projected corners
            [px], of all views and of each.
        views: The views used.
        left_out: Number of views left out because their error is `OUTLIER` times the median.
        residuals: (n, 2) [px] of all corners, measured minus projected.
    """

    intrinsics: Intrinsics
    std: tuple[float, ...]
    residual: float
    errors: tuple[float, ...]
    views: tuple[View, ...]
    left_out: int
    residuals: Floats


def fit_intrinsics(
    views: Sequence[View], size: tuple[int, int], model: Model = "pinhole"
) -> CameraFit:
    """Fit a camera model to views of a board; views with large errors are left out once.

    Args:
        views: At least 3; `tautscope.calibration.camera.coverage` says whether they suffice.
        size: Width and height of the images [px].
        model: ``pinhole`` for lenses up to about 100 degrees, else ``fisheye``.

    Raises:
        CalibrationError: The views do not determine the camera, or do not agree with the board.
    """
    fit = _fit(views, size, model)
    limit = OUTLIER * float(np.median(fit.errors))
    kept = [view for view, error in zip(views, fit.errors, strict=True) if error <= limit]
    if 3 <= len(kept) < len(views):
        fit = _fit(kept, size, model, len(views) - len(kept))
    if not fit.residual <= LARGEST_RESIDUAL:
        raise CalibrationError(
            f"the corners are {fit.residual:.2g} px off the fitted camera on average",
            "Is the board flat, do columns and rows agree with the print, did zoom and focus stay? "
            "For a wide lens, try --model fisheye",
        )
    return fit


def _fit(
    views: Sequence[View], size: tuple[int, int], model: Model, left_out: int = 0
) -> CameraFit:
    try:
        matrix, distortion, turns, shifts = _calibrate(views, size, model)
    except cv2.error as error:
        what = f"OpenCV cannot determine the camera from {len(views)} views ({error.err})"
        raise CalibrationError(what, "Show the board tilted, in all parts of the image") from None
    (fx, _, cx), (_, fy, cy), _ = matrix.tolist()
    camera = Intrinsics(size, model, (fx, fy), (cx, cy), tuple(map(float, distortion)))
    count = 4 + len(camera.distortion)
    information = np.zeros((count, count))
    residuals, errors = [], []
    for view, turn, shift in zip(views, turns, shifts, strict=True):
        pixels, jacobian = _project(camera, view.points.astype(np.float64), turn, shift)
        difference = view.pixels - pixels
        residuals.append(difference)
        errors.append(float(np.sqrt((difference**2).sum(axis=1).mean())))
        by_camera, (basis, _) = jacobian[:, 6:], np.linalg.qr(jacobian[:, :6])
        free = by_camera - basis @ (basis.T @ by_camera)
        information += free.T @ free
    every = np.concatenate(residuals)
    unknowns = count + 6 * len(views)
    variance = float((every**2).sum()) / max(every.size - unknowns, 1)
    try:
        covariance = variance * np.linalg.inv(information)
    except np.linalg.LinAlgError:
        covariance = np.full((count, count), np.inf)
    std = tuple(np.sqrt(np.abs(np.diag(covariance))).tolist())
    residual = float(np.sqrt((every**2).sum(axis=1).mean()))
    return CameraFit(camera, std, residual, tuple(errors), tuple(views), left_out, every)


def _calibrate(
    views: Sequence[View], size: tuple[int, int], model: Model
) -> tuple[Floats, Floats, Sequence[Floats], Sequence[Floats]]:
    """Camera matrix, distortion, and pose of each view, by OpenCV."""
    points, pixels = [view.points for view in views], [view.pixels for view in views]
    if model == "pinhole":
        _, matrix, distortion, turns, shifts = cv2.calibrateCamera(points, pixels, size, None, None)
    else:
        # OpenCV 5 has the flags without the namespace.
        flags = sum(
            getattr(cv2, f"CALIB_{name}", None) or getattr(cv2.fisheye, f"CALIB_{name}")
            for name in ("RECOMPUTE_EXTRINSIC", "FIX_SKEW")
        )
        _, matrix, distortion, turns, shifts = cv2.fisheye.calibrate(
            [each[None].astype(np.float64) for each in points],
            [each[None].astype(np.float64) for each in pixels],
            size,
            np.eye(3),
            np.zeros(4),
            flags=flags,
        )
    coefficients = np.asarray(distortion, np.float64).ravel()[: _DISTORTION[model]]
    return np.asarray(matrix, np.float64), coefficients, turns, shifts  # type: ignore[return-value]


def _project(
    camera: Intrinsics, points: Floats, turn: Floats, shift: Floats
) -> tuple[Floats, Floats]:
    """Pixels (n, 2) and their Jacobian (2 n, 6 + 4 + distortion) by pose and camera."""
    turn, shift = np.asarray(turn, np.float64).ravel(), np.asarray(shift, np.float64).ravel()
    distortion = np.array(camera.distortion, np.float64)
    if camera.model == "pinhole":
        pixels, jacobian = cv2.projectPoints(points, turn, shift, camera.matrix, distortion)
        # Pose, focal lengths, centre, distortion.
        jacobian = jacobian[:, : 10 + len(distortion)]
    else:
        pixels, columns = cv2.fisheye.projectPoints(
            points[:, None], turn, shift, camera.matrix, distortion
        )
        # OpenCV's order: focal lengths, centre, distortion, rotation, translation, skew.
        jacobian = columns[:, [*range(8, 14), *range(8)]]
    return np.asarray(pixels, np.float64).reshape(-1, 2), np.asarray(jacobian, np.float64)
