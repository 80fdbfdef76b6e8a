"""Outline of a band: area, centroid and moments against OpenCV; nearest state of features."""

import cv2
import numpy as np
import pytest
from tautscope.config import Config
from tautscope.loop.construction import build_feature_model

MODEL = build_feature_model(Config())


def states(count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform([0.015, -2.0, 0.2], [0.038, 2.0, 1.3], (count, 3))


@pytest.mark.parametrize("seed", range(5))
def test_moments_equal_opencvs_of_the_outline(seed: int) -> None:
    for state in states(20, seed):
        for area, centroid, moments, outline in MODEL.bands(state) or ():
            expected = cv2.moments((outline - outline[0]).astype(np.float32))
            assert area == pytest.approx(abs(expected["m00"]), rel=1e-4)
            expected_centroid = (
                np.array([expected["m10"], expected["m01"]]) / expected["m00"] + outline[0]
            )
            np.testing.assert_allclose(centroid, expected_centroid, atol=0.01)
            covariance = np.array([expected[name] for name in ("mu20", "mu11", "mu11", "mu02")])
            covariance = covariance.reshape(2, 2) / expected["m00"]
            np.testing.assert_allclose(moments, covariance, atol=2e-3 * np.trace(covariance))


@pytest.mark.parametrize("seed", range(5))
def test_the_centroid_is_the_predicted_feature_up_to_distortion(seed: int) -> None:
    for state in states(50, seed):
        bands, prediction = MODEL.bands(state), MODEL.predict(state)
        assert (bands is None) == (prediction is None)
        if bands is None or prediction is None:
            continue  # seen along the axis
        centroids = np.concatenate([band[1] for band in bands])
        np.testing.assert_allclose(centroids, prediction[0], atol=0.6, err_msg=str(state))


@pytest.mark.parametrize("seed", range(5))
def test_the_nearest_state_reproduces_the_features(seed: int) -> None:
    rng = np.random.default_rng(seed)
    std = np.array([5e-3, 0.3, 0.3])
    for state in states(50, seed):
        prediction = MODEL.predict(state)
        if prediction is None:
            continue  # seen along the axis
        start = state + rng.normal(0, 0.5, 3) * std
        found = MODEL.nearest_state(start, 100 * std, prediction[0], np.full(4, 0.1))
        if found is None:
            assert MODEL.predict(start) is None
            continue
        seen = MODEL.predict(found[0])
        assert seen is not None
        np.testing.assert_allclose(seen[0], prediction[0], atol=0.3, err_msg=str(state))


def test_without_measurements_the_nearest_state_is_the_prior() -> None:
    state = np.array([0.025, 0.3, 0.8])
    nothing = np.full(4, np.nan)
    found = MODEL.nearest_state(state, [1e-3, 0.1, 0.1], nothing, np.full(4, 1.0))
    assert found is not None
    np.testing.assert_allclose(found[0], state)
    assert found[1] == 0
