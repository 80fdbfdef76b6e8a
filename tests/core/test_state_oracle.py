"""State estimation, Eqs. (13)-(16), against numpy's pseudo-inverse, and its rank check."""

import numpy as np
import pytest
from tautscope import _core
from tautscope.config import Config
from tautscope.loop.construction import build_feature_model, build_state_estimator

NEVER_HELD = (1e9, 1e9, 1e9)


@pytest.mark.parametrize("seed", range(5))
def test_the_step_equals_numpys_pinv(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = build_feature_model(Config())
    estimator = _core.StateEstimator(observable_deviation=NEVER_HELD)
    for _ in range(50):
        state = rng.uniform([0.015, -1.5, 0.2], [0.035, 1.5, 1.2])
        prediction = model.predict(state)
        assert prediction is not None
        features, matrix = prediction
        innovation = rng.normal(0.0, 5.0, 4)
        found, observable, std = estimator.estimate(state, features, matrix, features + innovation)
        # rcond keeps all columns, which differ in scale by their units.
        expected = state + np.linalg.pinv(matrix, rcond=1e-15) @ innovation
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-10, err_msg=f"{seed}")
        covariance = np.linalg.inv(matrix.T @ matrix)
        np.testing.assert_allclose(std, np.sqrt(np.diag(covariance)), rtol=1e-8)
        assert observable.all()


def test_run_equals_one_estimate_per_row() -> None:
    rng = np.random.default_rng(7)
    model, estimator = build_feature_model(Config()), build_state_estimator(Config())
    states = rng.uniform([0.015, -1.5, 0.0], [0.035, 1.5, 1.2], (100, 3))
    measured = rng.uniform(100.0, 500.0, (100, 4))
    found, observable = estimator.run(model, states, measured)
    for k, state in enumerate(states):
        prediction = model.predict(state)
        if prediction is None:
            np.testing.assert_array_equal(found[k], state)
            assert not observable[k].any()
            continue
        one = estimator.estimate(state, *prediction, measured[k])
        np.testing.assert_array_equal(found[k], one[0])
        np.testing.assert_array_equal(observable[k], one[1])


def test_rotation_is_held_only_where_it_is_unobservable() -> None:
    config = Config().replace(**{"insertion.observable_deviation": 5e-3})
    model, estimator = build_feature_model(config), build_state_estimator(config)
    limit = config.rotation.observable_deviation
    held = []
    for bend in np.linspace(-1.0, 1.0, 401):
        state = np.array([0.025, 0.3, bend])
        prediction = model.predict(state)
        assert prediction is not None
        features, matrix = prediction
        found, observable, _ = estimator.estimate(state, features, matrix, features + 1.0)
        if np.abs(bend) > 1e-9:
            covariance = np.linalg.inv(matrix.T @ matrix)
            assert observable[1] == (np.sqrt(covariance[1, 1]) <= limit), bend
        if not observable[1]:
            held.append(bend)
            assert found[1] == state[1]
            others = matrix[:, [0, 2]]
            expected = state[[0, 2]] + np.linalg.pinv(others) @ np.ones(4)
            np.testing.assert_allclose(found[[0, 2]], expected, rtol=1e-10)
    assert 0.0 in held and max(np.abs(held)) < 0.5


def test_inputs_of_the_wrong_shape_are_named() -> None:
    estimator = _core.StateEstimator(observable_deviation=NEVER_HELD)
    with pytest.raises(ValueError, match="interaction_matrix"):
        estimator.estimate(np.zeros(3), np.zeros(4), np.zeros((3, 3)), np.zeros(4))
    with pytest.raises(ValueError, match="measured_features"):
        estimator.estimate(np.zeros(3), np.zeros(4), np.zeros((4, 3)), np.zeros(3))
