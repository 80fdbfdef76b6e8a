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
DEVIATION = np.array([1e-3, 0.1, 0.05])
NEVER = 1e12


def estimator(**changes: float) -> _core.WeightedEstimator:
    return build_weighted_estimator(
        CONFIG.replace(**{f"state_estimation.{key}": value for key, value in changes.items()})
    )


def features(config: Config, state: Floats, sideways: float = 0.0) -> Floats:
    """h of a tip displaced across the bend: the same as a guide displaced the other way."""
    _, rotation, bending = state
    along, across = np.sin(bending / 2), np.cos(bending / 2)
    way = np.array([across * np.cos(rotation), across * np.sin(rotation), -along])
    pose = config.camera.camera_from_guide
    turn = Rotation.from_rotvec(pose.rotation).as_matrix()
    moved = np.array(pose.translation) + sideways * turn @ way
    displaced = _core.FeatureModel(
        build_instrument(config),
        build_camera(config),
        translation=tuple(moved),
        rotation=pose.rotation,
    )
    prediction = displaced.predict(state)
    assert prediction is not None
    return prediction[0]


def draw(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """A state and a belief of it."""
    state = rng.uniform([0.015, -1.5, 0.4], [0.035, 1.5, 1.4])
    return state, state + DEVIATION * rng.standard_normal(3)


def covariance(rng: np.random.Generator) -> Floats:
    """Of two markers that know nothing of each other."""
    blocks = np.zeros((4, 4))
    for at in (slice(0, 2), slice(2, 4)):
        root = rng.normal(0.0, 0.4, (2, 2))
        blocks[at, at] = root @ root.T + 0.01 * np.eye(2)
    return blocks


def scipys(
    belief: Floats, measured: Floats, spread: Floats, used: list[int]
) -> tuple[Floats, float]:
    """Most probable state for the features used, and twice SciPy's cost."""
    root = (
        np.linalg.inv(np.linalg.cholesky(spread[np.ix_(used, used)])) if used else np.empty((0, 0))
    )

    def misfit(away: Floats) -> Floats:
        seen = (measured - features(CONFIG, belief + DEVIATION * away))[used]
        return np.concatenate([root @ seen, away])

    found = least_squares(misfit, np.zeros(3), xtol=1e-15, ftol=1e-15, gtol=1e-12)
    return belief + DEVIATION * found.x, 2 * found.cost


@pytest.mark.parametrize("seed", range(5))
def test_with_one_step_and_no_belief_it_is_the_articles_step(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model = build_feature_model(CONFIG)
    plain = estimator(model_deviation=0.0, sideways_deviation=0.0, outlier_distance=NEVER, steps=1)
    state, belief = draw(rng)
    prediction = model.predict(belief)
    assert prediction is not None
    measured = features(CONFIG, state)
    found = plain.estimate(model, belief, np.full(3, 1e6), measured, np.eye(4))
    assert found is not None
    step = np.linalg.pinv(prediction[1], rcond=1e-15) @ (measured - prediction[0])
    np.testing.assert_allclose(found[0], belief + step, rtol=0, atol=1e-9, err_msg=f"{seed}")


@pytest.mark.parametrize("seed", range(5))
def test_it_is_scipys_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    plain = estimator(model_deviation=0.0, sideways_deviation=0.0, outlier_distance=NEVER, steps=50)
    state, belief = draw(rng)
    spread = covariance(rng)
    measured = features(CONFIG, state) + rng.multivariate_normal(np.zeros(4), spread)
    found = plain.estimate(build_feature_model(CONFIG), belief, DEVIATION, measured, spread)
    assert found is not None
    expected, _ = scipys(belief, measured, spread, [0, 1, 2, 3])
    np.testing.assert_allclose(
        found[0] / DEVIATION, expected / DEVIATION, rtol=0, atol=1e-6, err_msg=f"{seed}"
    )


@pytest.mark.parametrize("seed", range(5))
def test_an_uneven_bend_is_one_more_unknown(seed: int) -> None:
    rng = np.random.default_rng(seed)
    width, noise = 0.5e-3, 0.2
    uneven = estimator(model_deviation=0.0, sideways_deviation=width, outlier_distance=NEVER)
    state, belief = draw(rng)
    measured = features(CONFIG, state, width) + rng.normal(0.0, noise, 4)

    def misfit(unknown: Floats) -> Floats:
        seen = measured - features(CONFIG, belief + DEVIATION * unknown[:3], width * unknown[3])
        return np.concatenate([seen / noise, unknown])

    expected = belief + DEVIATION * least_squares(misfit, np.zeros(4), xtol=1e-12).x[:3]
    found = uneven.estimate(
        build_feature_model(CONFIG), belief, DEVIATION, measured, noise**2 * np.eye(4)
    )
    assert found is not None
    # SciPy bends h along the displacement too; ours is linear in it.
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
    state, belief = draw(rng)
    spread = 0.09 * np.eye(4)
    measured = features(CONFIG, state) + rng.normal(0.0, 0.3, 4)
    wrong = seed % 4
    measured[:2] += 60.0 * (wrong in (1, 3))
    measured[2:] -= 90.0 * (wrong in (2, 3))
    costs = {}
    for used in itertools.product((True, False), repeat=2):
        rows = [2 * m + axis for m in range(2) if used[m] for axis in range(2)]
        answer, cost = scipys(belief, measured, spread, rows)
        costs[used] = (cost + distance**2 * (2 - sum(used)), answer)
    used, (_, expected) = min(costs.items(), key=lambda item: item[1][0])
    found = robust.estimate(build_feature_model(CONFIG), belief, DEVIATION, measured, spread)
    assert found is not None
    assert tuple(found[3]) == used == (wrong not in (1, 3), wrong not in (2, 3)), seed
    np.testing.assert_allclose(
        found[0] / DEVIATION, expected / DEVIATION, rtol=0, atol=1e-5, err_msg=f"{seed}"
    )


@pytest.mark.parametrize("seed", [0, 1])
def test_the_deviations_are_those_of_monte_carlo(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count, noise = 3000, 0.3
    width = CONFIG.state_estimation.sideways_deviation
    ours, model = (
        estimator(model_deviation=0.0, outlier_distance=NEVER),
        build_feature_model(CONFIG),
    )
    near = 0.3 * DEVIATION
    state = draw(rng)[0]
    beliefs = state + near * rng.standard_normal((count, 3))
    push = features(CONFIG, state, width) - features(CONFIG, state)
    measured = features(CONFIG, state) + rng.normal(0.0, noise, (count, 4))
    measured += push * rng.standard_normal((count, 1))
    found, deviation, _ = ours.run(model, beliefs, near, measured, noise**2 * np.eye(4))
    ratio = np.mean(((found - state) / deviation) ** 2, axis=0)
    # Standard error of a mean of chi squared: sqrt(2 / 3000), 2.6 %.
    np.testing.assert_allclose(ratio, 1.0, atol=0.1, err_msg=f"{seed}")


def test_the_image_alone_leaves_the_belief_out() -> None:
    rng = np.random.default_rng(3)
    plain = estimator(model_deviation=0.0, sideways_deviation=0.0, outlier_distance=NEVER, steps=50)
    model = build_feature_model(CONFIG)
    state, belief = draw(rng)
    measured, spread = features(CONFIG, state), 0.04 * np.eye(4)
    found = plain.estimate(model, belief, DEVIATION, measured, spread)
    alone = plain.estimate(model, belief, np.full(3, 1e3), measured, spread)
    assert found is not None and alone is not None
    assert np.all(np.abs(found[0] - state) > 10 * np.abs(found[4] - state))
    np.testing.assert_allclose(found[5], alone[1], rtol=0.05)
    assert np.all(found[1] < found[5])


def test_a_lost_marker_holds_what_the_other_does_not_say() -> None:
    rng = np.random.default_rng(5)
    model, ours = build_feature_model(CONFIG), estimator()
    state, belief = draw(rng)
    measured = features(CONFIG, state)
    measured[2:] = np.nan
    found = ours.estimate(model, belief, DEVIATION, measured)
    assert found is not None
    _, deviation, observable, used, image, _ = found
    assert list(used) == [True, False]
    assert not observable.all()
    assert np.isnan(image[~observable]).all() and np.isfinite(image[observable]).all()
    assert np.isfinite(deviation).all() and np.all(deviation <= DEVIATION)


@pytest.mark.parametrize("seed", range(3))
def test_close_to_straight_rotation_is_held_where_it_is_believed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    model, ours = build_feature_model(CONFIG), estimator()
    state = np.array([0.03, rng.uniform(-1, 1), 2e-3])
    measured = features(CONFIG, state) + rng.normal(0, 0.3, 4)
    belief = state + np.array([0.5e-3, 0.2, 0.01])
    found = ours.estimate(model, belief, DEVIATION, measured, 0.09 * np.eye(4))
    assert found is not None
    assert list(found[2]) == [True, False, True]
    assert abs(found[0][1] - belief[1]) < 1e-3 * DEVIATION[1]
    assert found[1][1] == DEVIATION[1]
    assert np.all(np.abs(found[0] - state)[[0, 2]] < 5 * found[1][[0, 2]])


def test_half_a_turn_on_and_bent_the_other_way_is_the_same_posture() -> None:
    model = build_feature_model(CONFIG)
    for half in (np.pi, -np.pi):
        one = model.predict(np.array([0.03, 0.4, 0.9]))
        other = model.predict(np.array([0.03, 0.4 + half, -0.9]))
        assert one is not None and other is not None
        np.testing.assert_allclose(one[0], other[0], atol=1e-9)


def test_a_correction_is_not_added_twice() -> None:
    """The model is corrected when an image arrives, the belief when it was taken: 80 ms between."""
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
                belief = loop.predict_state(captured_at)
                assert belief is not None
                assert np.all(np.abs(belief.state - truth) < [0.1e-3, 0.01, 0.005]), tick
            loop.on_features(prediction[0], captured_at)
    assert np.all(np.abs(loop.predicted_state - truth) < [0.2e-3, 0.02, 0.01])


def test_a_wrong_belief_gives_way_in_the_end() -> None:
    """Both markers say the same, again and again, against a belief that was sure.

    Without the guards, which would hold what was believed for ``safety.hold_time`` first.
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
