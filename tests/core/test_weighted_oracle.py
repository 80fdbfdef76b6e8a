"""The state estimate of profile `best` against SciPy, NumPy and Monte Carlo; decision 0018."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from tautscope import _core
from tautscope.config import Config, load_config
from tautscope.loop.construction import (
    build_camera,
    build_feature_model,
    build_instrument,
    build_weighted_estimator,
)
from tautscope.loop.reduction import HysteresisReduction

Floats = NDArray[np.float64]
CONFIG = load_config(profile="best")
STD = np.array([1e-3, 0.1, 0.05])
NEVER = 1e12


def estimator(**changes: float) -> _core.WeightedEstimator:
    return build_weighted_estimator(
        CONFIG.replace(**{f"state_estimation.{key}": value for key, value in changes.items()})
    )


def features(config: Config, state: Floats, sideways: float = 0.0) -> Floats:
    """h of a tip displaced across the bend by `sideways` [m], computed by a displaced guide."""
    _, rotation, bending = state
    along, across = np.sin(bending / 2), np.cos(bending / 2)
    direction = np.array([across * np.cos(rotation), across * np.sin(rotation), -along])
    pose = config.camera.camera_from_guide
    rotation_matrix = Rotation.from_rotvec(pose.rotation).as_matrix()
    translation = np.array(pose.translation) + sideways * rotation_matrix @ direction
    displaced = _core.FeatureModel(
        build_instrument(config),
        build_camera(config),
        translation=tuple(translation),
        rotation=pose.rotation,
    )
    prediction = displaced.predict(state)
    assert prediction is not None
    return prediction[0]


def draw(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """A state and a prior mean of it."""
    state = rng.uniform([0.015, -1.5, 0.4], [0.035, 1.5, 1.4])
    return state, state + STD * rng.standard_normal(3)


def covariance(rng: np.random.Generator) -> Floats:
    """Covariance (4, 4) in px^2 of two independent markers."""
    blocks = np.zeros((4, 4))
    for at in (slice(0, 2), slice(2, 4)):
        root = rng.normal(0.0, 0.4, (2, 2))
        blocks[at, at] = root @ root.T + 0.01 * np.eye(2)
    return blocks


def scipy_estimate(
    prior: Floats, measured: Floats, marker_covariance: Floats, used: list[int]
) -> tuple[Floats, float]:
    """Most probable state for the features used, and twice the cost of SciPy."""
    root = (
        np.linalg.inv(np.linalg.cholesky(marker_covariance[np.ix_(used, used)]))
        if used
        else np.empty((0, 0))
    )

    def misfit(scaled: Floats) -> Floats:
        residual = (measured - features(CONFIG, prior + STD * scaled))[used]
        return np.concatenate([root @ residual, scaled])

    found = least_squares(misfit, np.zeros(3), xtol=1e-15, ftol=1e-15, gtol=1e-12)
    return prior + STD * found.x, 2 * found.cost


@pytest.mark.parametrize("seed", range(5))
def test_one_step_without_prior_equals_the_articles_step(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = build_feature_model(CONFIG)
    plain = estimator(model_deviation=0.0, sideways_deviation=0.0, outlier_distance=NEVER, steps=1)
    state, prior = draw(rng)
    prediction = model.predict(prior)
    assert prediction is not None
    measured = features(CONFIG, state)
    found = plain.estimate(model, prior, np.full(3, 1e6), measured, np.eye(4))
    assert found is not None
    step = np.linalg.pinv(prediction[1], rcond=1e-15) @ (measured - prediction[0])
    np.testing.assert_allclose(found[0], prior + step, rtol=0, atol=1e-9, err_msg=f"{seed}")


@pytest.mark.parametrize("seed", range(5))
def test_estimate_equals_scipys_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plain = estimator(model_deviation=0.0, sideways_deviation=0.0, outlier_distance=NEVER, steps=50)
    state, prior = draw(rng)
    marker_covariance = covariance(rng)
    measured = features(CONFIG, state) + rng.multivariate_normal(np.zeros(4), marker_covariance)
    found = plain.estimate(build_feature_model(CONFIG), prior, STD, measured, marker_covariance)
    assert found is not None
    expected, _ = scipy_estimate(prior, measured, marker_covariance, [0, 1, 2, 3])
    np.testing.assert_allclose(found[0] / STD, expected / STD, rtol=0, atol=1e-6, err_msg=f"{seed}")


@pytest.mark.parametrize("seed", range(5))
def test_uneven_curvature_is_an_additional_unknown(seed: int) -> None:
    rng = np.random.default_rng(seed)
    width, noise = 0.5e-3, 0.2
    uneven = estimator(model_deviation=0.0, sideways_deviation=width, outlier_distance=NEVER)
    state, prior = draw(rng)
    measured = features(CONFIG, state, width) + rng.normal(0.0, noise, 4)

    def misfit(unknown: Floats) -> Floats:
        residual = measured - features(CONFIG, prior + STD * unknown[:3], width * unknown[3])
        return np.concatenate([residual / noise, unknown])

    expected = prior + STD * least_squares(misfit, np.zeros(4), xtol=1e-12).x[:3]
    found = uneven.estimate(build_feature_model(CONFIG), prior, STD, measured, noise**2 * np.eye(4))
    assert found is not None
    # In SciPy's problem h is nonlinear in the displacement, too.
    assert np.all(np.abs(found[0] - expected) < 0.1 * found[1]), (
        seed,
        found[0] - expected,
        found[1],
    )


@pytest.mark.parametrize("seed", range(8))
def test_the_markers_used_are_those_of_least_cost(seed: int) -> None:
    rng = np.random.default_rng(seed)
    distance = 4.0
    robust = estimator(
        model_deviation=0.0, sideways_deviation=0.0, outlier_distance=distance, steps=50
    )
    state, prior = draw(rng)
    marker_covariance = 0.09 * np.eye(4)
    measured = features(CONFIG, state) + rng.normal(0.0, 0.3, 4)
    wrong = seed % 4
    measured[:2] += 60.0 * (wrong in (1, 3))
    measured[2:] -= 90.0 * (wrong in (2, 3))
    costs = {}
    for used in itertools.product((True, False), repeat=2):
        rows = [2 * m + axis for m in range(2) if used[m] for axis in range(2)]
        answer, cost = scipy_estimate(prior, measured, marker_covariance, rows)
        costs[used] = (cost + distance**2 * (2 - sum(used)), answer)
    used, (_, expected) = min(costs.items(), key=lambda item: item[1][0])
    found = robust.estimate(build_feature_model(CONFIG), prior, STD, measured, marker_covariance)
    assert found is not None
    assert tuple(found[3]) == used == (wrong not in (1, 3), wrong not in (2, 3)), seed
    np.testing.assert_allclose(found[0] / STD, expected / STD, rtol=0, atol=1e-5, err_msg=f"{seed}")


@pytest.mark.parametrize("seed", [0, 1])
def test_std_matches_monte_carlo(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, noise = 3000, 0.3
    width = CONFIG.state_estimation.sideways_deviation
    ours, model = (
        estimator(model_deviation=0.0, outlier_distance=NEVER),
        build_feature_model(CONFIG),
    )
    prior_std = 0.3 * STD
    state = draw(rng)[0]
    priors = state + prior_std * rng.standard_normal((count, 3))
    displacement = features(CONFIG, state, width) - features(CONFIG, state)
    measured = features(CONFIG, state) + rng.normal(0.0, noise, (count, 4))
    measured += displacement * rng.standard_normal((count, 1))
    found, std, _ = ours.run(model, priors, prior_std, measured, noise**2 * np.eye(4))
    ratio = np.mean(((found - state) / std) ** 2, axis=0)
    # Standard error of a mean of chi squared: sqrt(2 / 3000), 2.6 %.
    np.testing.assert_allclose(ratio, 1.0, atol=0.1, err_msg=f"{seed}")


def test_the_image_only_estimate_excludes_the_prior() -> None:
    rng = np.random.default_rng(3)
    plain = estimator(model_deviation=0.0, sideways_deviation=0.0, outlier_distance=NEVER, steps=50)
    model = build_feature_model(CONFIG)
    state, prior = draw(rng)
    measured, marker_covariance = features(CONFIG, state), 0.04 * np.eye(4)
    found = plain.estimate(model, prior, STD, measured, marker_covariance)
    alone = plain.estimate(model, prior, np.full(3, 1e3), measured, marker_covariance)
    assert found is not None and alone is not None
    assert np.all(np.abs(found[0] - state) > 10 * np.abs(found[4] - state))
    np.testing.assert_allclose(found[5], alone[1], rtol=0.05)
    assert np.all(found[1] < found[5])


def test_with_one_marker_unobservable_dofs_are_held() -> None:
    rng = np.random.default_rng(5)
    model, ours = build_feature_model(CONFIG), estimator()
    state, prior = draw(rng)
    measured = features(CONFIG, state)
    measured[2:] = np.nan
    found = ours.estimate(model, prior, STD, measured)
    assert found is not None
    _, std, observable, used, image, _ = found
    assert list(used) == [True, False]
    assert not observable.all()
    assert np.isnan(image[~observable]).all() and np.isfinite(image[observable]).all()
    assert np.isfinite(std).all() and np.all(std <= STD)


@pytest.mark.parametrize("seed", range(3))
def test_near_zero_bend_rotation_is_held_at_its_prior(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model, ours = build_feature_model(CONFIG), estimator()
    state = np.array([0.03, rng.uniform(-1, 1), 2e-3])
    measured = features(CONFIG, state) + rng.normal(0, 0.3, 4)
    prior = state + np.array([0.5e-3, 0.2, 0.01])
    found = ours.estimate(model, prior, STD, measured, 0.09 * np.eye(4))
    assert found is not None
    assert list(found[2]) == [True, False, True]
    assert abs(found[0][1] - prior[1]) < 1e-3 * STD[1]
    assert found[1][1] == STD[1]
    assert np.all(np.abs(found[0] - state)[[0, 2]] < 5 * found[1][[0, 2]])


def test_a_half_turn_with_opposite_bend_has_equal_features() -> None:
    model = build_feature_model(CONFIG)
    for half in (np.pi, -np.pi):
        one = model.predict(np.array([0.03, 0.4, 0.9]))
        other = model.predict(np.array([0.03, 0.4 + half, -0.9]))
        assert one is not None and other is not None
        np.testing.assert_allclose(one[0], other[0], atol=1e-9)


def test_a_correction_is_not_added_twice() -> None:
    """The play state is corrected at an image's arrival, the prior at its capture, 80 ms before."""
    period, latency = CONFIG.control.period, 16
    slack = {"insertion": 5e-3, "rotation": 0.5, "bending": 0.3}
    config = CONFIG.replace(
        **{f"{dof}.delta_minus": -half for dof, half in slack.items()},
        **{f"{dof}.delta_plus": half for dof, half in slack.items()},
    )
    loop, model = HysteresisReduction(config), build_feature_model(config)
    reference = np.array([0.025, 0.0, 0.9])
    truth = reference - [2e-3, 0.2, 0.1]
    prediction = model.predict(truth)
    assert prediction is not None
    for tick in range(200):
        loop.step(reference, tick * period)
        if tick >= latency and tick % 8 == 0:
            captured_at = (tick - latency) * period
            if tick > 3 * latency:
                prior = loop.predict_state(captured_at)
                assert prior is not None
                assert np.all(np.abs(prior.state - truth) < [0.1e-3, 0.01, 0.005]), tick
            loop.on_features(prediction[0], captured_at)
    assert np.all(np.abs(loop.predicted_state - truth) < [0.2e-3, 0.02, 0.01])


def test_repeated_measurements_correct_a_wrong_prior() -> None:
    """Consistent measurements of both markers overcome a prior with a small standard deviation.

    The monitors are off: they would hold the prior for ``safety.hold_time`` first.
    """
    period = CONFIG.control.period
    config = CONFIG.replace(**{"safety.off": ["innovation", "jump", "swapped"]})
    loop, model = HysteresisReduction(config), build_feature_model(CONFIG)
    reference = np.array([0.025, 0.0, 0.9])
    tick = 0
    for truth in (reference, reference + np.array([4e-3, 0.4, 0.4])):
        prediction = model.predict(truth)
        assert prediction is not None
        for _ in range(40):
            for _ in range(8):
                loop.step(reference, tick * period)
                tick += 1
            report = loop.on_features(prediction[0], (tick - 1) * period)
        assert np.all(np.abs(report.state_estimate - truth) < [0.1e-3, 0.01, 0.005])
