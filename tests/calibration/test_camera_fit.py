"""Intrinsics from a board; OpenCV is the oracle of covariance and projection."""

import cv2
import numpy as np
import pytest
from boards import BOARD, CONFIG, FISHEYE, SIZE, pinhole, projected_views, rendered, values
from tautscope.calibration.camera.board import Board, View
from tautscope.calibration.camera.intrinsics import Intrinsics, fit_intrinsics
from tautscope.calibration.camera.result import to_loop_model
from tautscope.errors import CalibrationError, FieldError


def test_values_and_deviations_are_those_of_opencv() -> None:
    views = projected_views(pinhole(), seed=0)
    fit = fit_intrinsics(views, SIZE)
    rms, matrix, distortion, *_, deviations, _, errors = cv2.calibrateCameraExtended(
        [view.points for view in views], [view.pixels for view in views], SIZE, None, None
    )
    fx, fy, cx, cy = matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]
    expected = [fx, fy, cx, cy, *distortion.ravel()[:5]]
    # OpenCV adds up in an order that depends on its threads.
    assert (np.abs(values(fit.intrinsics) - expected) < 1e-3 * deviations.ravel()[:9]).all()
    assert fit.std == pytest.approx(deviations.ravel()[:9], rel=1e-3)
    assert fit.residual == pytest.approx(rms, rel=1e-6)
    assert fit.errors == pytest.approx(errors.ravel(), rel=1e-4)


@pytest.mark.parametrize("camera", [pinhole(), FISHEYE], ids=["pinhole", "fisheye"])
def test_errors_are_as_large_as_their_standard_deviations(camera: Intrinsics) -> None:
    scores = []
    for seed in range(12):
        fit = fit_intrinsics(projected_views(camera, seed), SIZE, camera.model)
        scores.append((values(fit.intrinsics) - values(camera)) / np.array(fit.std))
    rms = np.sqrt(np.mean(np.square(scores), axis=0))
    # A mean of 12 squares of a normal variable is in this range with probability 0.9998.
    assert (rms > 0.35).all()
    assert (rms < 1.75).all()


def test_rendered_boards_give_the_camera_within_its_deviations() -> None:
    scores = []
    for seed in range(3):
        config = CONFIG.replace(**{"twin.seed": seed})
        found = [
            BOARD.find(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)) for image in rendered(config, 25)
        ]
        views = [view for view in found if view is not None]
        assert len(views) >= 23
        fit = fit_intrinsics(views, SIZE)
        assert fit.residual < 0.15
        scores.append((values(fit.intrinsics) - values(pinhole())) / np.array(fit.std))
    assert np.abs(scores).max() < 4
    assert 0.3 < np.sqrt(np.mean(np.square(scores))) < 1.6


def test_a_view_with_errors_is_left_out() -> None:
    views = projected_views(pinhole(), seed=1)
    wrong = views[3]
    moved = wrong.pixels + np.float32(2) * np.random.default_rng(1).standard_normal(
        wrong.pixels.shape, dtype=np.float32
    )
    views[3] = View(wrong.ids, wrong.points, moved, 0.0)
    fit = fit_intrinsics(views, SIZE)
    assert fit.left_out == 1
    assert fit.residual < 0.1
    assert np.abs((values(fit.intrinsics) - values(pinhole())) / np.array(fit.std)).max() < 5


def test_views_of_another_board_are_refused() -> None:
    views = projected_views(pinhole(), seed=2)
    stretched = [
        View(view.ids, view.points * np.float32((1 + 0.02 * k, 1, 1)), view.pixels, 0.0)
        for k, view in enumerate(views)
    ]
    with pytest.raises(CalibrationError, match="px off"):
        fit_intrinsics(stretched, SIZE)


@pytest.mark.parametrize("focal", [200.0, 330.0, 500.0])
@pytest.mark.parametrize("distortion", [(0, 0, 0, 0), (0.05, -0.02, 0.004, -0.001)])
def test_a_fisheye_lens_is_converted(focal: float, distortion: tuple[float, ...]) -> None:
    lens = Intrinsics(SIZE, "fisheye", (focal, 1.03 * focal), (355.0, 290.0), distortion)
    converted, error = to_loop_model(lens)
    angles, around = np.meshgrid(np.radians(np.linspace(1, 50, 50)), np.linspace(0, 6.28, 20))
    radius = np.tan(angles).ravel()
    rays = np.column_stack(
        [radius * np.cos(around.ravel()), radius * np.sin(around.ravel()), np.ones(radius.size)]
    )
    zero = np.zeros(3)
    exact, _ = cv2.fisheye.projectPoints(
        rays[:, None], zero, zero, lens.matrix, np.array(distortion, float)
    )
    ours, _ = cv2.projectPoints(rays, zero, zero, converted.matrix, np.array(converted.distortion))
    difference = np.abs(exact.reshape(-1, 2) - ours.reshape(-1, 2)).max()
    assert difference <= 1.05 * error + 1e-6
    assert error < 0.03
    assert converted.distortion[2:4] == (0, 0)


def test_a_lens_that_folds_is_refused() -> None:
    lens = Intrinsics(SIZE, "fisheye", (300.0, 300.0), (360.0, 288.0), (-0.5, 0.0, 0.0, 0.0))
    with pytest.raises(CalibrationError, match="folds back"):
        to_loop_model(lens)


def test_a_lens_that_no_pinhole_resembles_is_refused() -> None:
    """Its angles grow with the radius, but the rational gain that is nearest is 20 px off."""
    distortion = (0.10, -0.07, 0.04, -0.004)
    lens = Intrinsics(SIZE, "fisheye", (235.0, 247.0), (360.0, 288.0), distortion)
    with pytest.raises(CalibrationError, match=r"nearest pinhole of the loop differ by \d+ px"):
        to_loop_model(lens)


def test_a_pinhole_is_kept() -> None:
    converted, error = to_loop_model(pinhole())
    assert error == 0
    assert converted.distortion == (*pinhole().distortion, 0, 0, 0)


@pytest.mark.parametrize(
    ("columns", "rows", "square", "field"),
    [(3, 7, 4e-3, "columns"), (9, 21, 4e-3, "rows"), (9, 7, 0.0, "square"), (9, 7, 4.0, "square")],
)
def test_an_impossible_board_is_refused(columns: int, rows: int, square: float, field: str) -> None:
    with pytest.raises(FieldError, match=field):
        Board(columns, rows, square)
