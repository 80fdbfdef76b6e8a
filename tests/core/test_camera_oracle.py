"""Projection, Eq. (8), and poses against OpenCV."""

import cv2
import numpy as np
import pytest
from tautscope import _core

FX, FY, CX, CY = 424.0, 454.0, 349.6, 285.0


def camera(distortion: np.ndarray) -> _core.Camera:
    return _core.Camera(fx=FX, fy=FY, cx=CX, cy=CY, distortion=tuple(distortion))


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_projection_equals_opencv(seed: int, rational: bool) -> None:
    rng = np.random.default_rng(seed)
    distortion = rng.uniform(-1.0, 1.0, 8) * [0.3, 0.1, 0.01, 0.01, 0.05, 0.2, 0.05, 0.02]
    if not rational:
        distortion[5:] = 0.0
    points = rng.uniform([-0.03, -0.03, 0.02], [0.03, 0.03, 0.08], (500, 3))
    matrix = np.array([[FX, 0.0, CX], [0.0, FY, CY], [0.0, 0.0, 1.0]])
    expected, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, distortion)
    found = camera(distortion).project(points)
    np.testing.assert_allclose(found, expected[:, 0], atol=1e-9, err_msg=f"seed {seed}")


def test_points_not_in_front_of_the_camera_have_no_image() -> None:
    points = [[0.0, 0.0, 0.0], [0.0, 0.0, -0.05], [np.nan, 0.0, 0.05], [0.0, 0.0, np.nan]]
    assert np.isnan(camera(np.zeros(8)).project(points)).all()


@pytest.mark.parametrize("seed", range(3))
def test_poses_equal_opencvs_rodrigues(seed: int) -> None:
    rng = np.random.default_rng(seed)
    # With radius and length 0 a band is a point.
    instrument = _core.Instrument(
        bending_length=0.01, marker_a=0.0, marker_b=0.01, radius=0.0, band_length=0.0
    )
    flat = camera(np.zeros(8))
    for rotation in (np.zeros(3), rng.normal(0.0, 1e-9, 3), rng.uniform(-0.5, 0.5, 3)):
        translation = rng.uniform([-0.01, -0.01, 0.01], [0.01, 0.01, 0.03])
        model = _core.FeatureModel(
            instrument, flat, translation=tuple(translation), rotation=tuple(rotation)
        )
        state = rng.uniform([0.02, -3.0, 0.2], [0.03, 3.0, 0.8])
        prediction = model.predict(state)
        assert prediction is not None
        matrix = cv2.Rodrigues(rotation)[0]
        expected = flat.project(translation + instrument.markers(state) @ matrix.T)
        np.testing.assert_allclose(prediction[0], expected.ravel(), atol=1e-9)
