"""Analytic Jacobians of f, g and h against finite differences, also near singular states."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.loop.construction import build_camera, build_feature_model, build_instrument

Floats = NDArray[np.float64]

# Zero, its neighbourhood, and both sides of the limits of the series (1, and 2 for half the bend).
BENDS = [0.0, 1e-12, -1e-7, 1e-3, -0.3, 0.999999, 1.000001, -1.0, 1.999999, 2.000001, 2.8]


def differences(function: Callable[[Floats], Floats], at: Floats, step: float) -> Floats:
    """Central differences, extrapolated once: fourth order."""

    def central(size: float) -> Floats:
        return np.column_stack(
            [(function(at + d) - function(at - d)) / (2 * size) for d in size * np.eye(len(at))]
        )

    return (4 * central(step / 2) - central(step)) / 3


@pytest.mark.parametrize("bend", BENDS)
def test_kinematics(bend: float) -> None:
    instrument = build_instrument(Config())
    state = np.array([0.02, 0.7, bend])
    expected = differences(lambda q: instrument.markers(q).ravel(), state, 1e-3)
    np.testing.assert_allclose(instrument.jacobian(state), expected, atol=1e-11)


@pytest.mark.parametrize("seed", range(5))
def test_camera(seed: int) -> None:
    rng = np.random.default_rng(seed)
    distortion = rng.uniform(-0.1, 0.1, 8).tolist()
    camera = build_camera(Config().replace(**{"camera.distortion": distortion}))
    point = rng.uniform([-0.02, -0.02, 0.03], [0.02, 0.02, 0.07])
    expected = differences(lambda p: camera.project(p[None])[0], point, 1e-4)
    found = camera.jacobian(point)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-4, err_msg=f"seed {seed}")


@pytest.mark.parametrize("bend", BENDS)
@pytest.mark.parametrize("thickness", [0.0, 1.0])
def test_features(bend: float, thickness: float) -> None:
    changes = {
        "instrument.diameter": 1e-9 + thickness * 3.5e-3,
        "instrument.band_length": 1e-9 + thickness * 4e-3,
        "safety.unusual": ["instrument.diameter", "instrument.band_length"],
    }
    model = build_feature_model(Config().replace(**changes))

    def features(state: Floats) -> Floats:
        prediction = model.predict(state)
        assert prediction is not None
        return prediction[0]

    state = np.array([0.02, 0.7, bend])
    prediction = model.predict(state)
    assert prediction is not None
    expected = differences(features, state, 1e-4)
    np.testing.assert_allclose(prediction[1], expected, rtol=1e-7, atol=1e-5)


def test_bend_zero_is_smooth() -> None:
    """The Jacobian is continuous to the precision of a double."""
    instrument = build_instrument(Config())
    bends = np.concatenate([-np.logspace(-1, -16, 200), [0.0], np.logspace(-16, -1, 200)])
    slopes = np.array([instrument.jacobian([0.02, 0.0, bend])[:, 2] for bend in bends])
    # d2f/dq3^2 is bounded by the length from guide to marker.
    assert (np.abs(np.diff(slopes, axis=0)) <= 0.035 * np.diff(bends)[:, None] + 1e-17).all()
