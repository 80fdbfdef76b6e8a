"""Whether the detection is as sure as it should be, and as good as is asked."""

import numpy as np
import pytest
from scenes import CONFIG, scenes
from tautscope.loop.vision import MarkerDetector


@pytest.mark.parametrize("seed", range(3))
def test_errors_are_as_large_as_the_covariance_says(seed: int) -> None:
    detector = MarkerDetector(CONFIG)
    squares, errors = [], []
    for number, scene in enumerate(scenes(60, seed)):
        detection = detector.detect(scene.image, expectation=scene.expectation(number))
        assert detection.valid, f"{seed=}, {number}: {detection.reason}"
        error = detection.features - scene.truth
        errors.append(error.reshape(2, 2))
        for band in (slice(0, 2), slice(2, 4)):
            covariance = detection.covariance[band, band]
            np.testing.assert_allclose(covariance, covariance.T)
            assert (np.linalg.eigvalsh(covariance) > 0).all()
            squares.append(error[band] @ np.linalg.solve(covariance, error[band]) / 2)
    assert 0.3 < np.mean(squares) < 2.0, f"{seed=}: {np.mean(squares)}"
    rms = np.sqrt((np.linalg.norm(errors, axis=2) ** 2).mean())
    assert rms < 0.2, f"{seed=}: {rms} px"
