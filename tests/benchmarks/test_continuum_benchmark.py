"""The benchmark of a real continuum robot: its model, its split, and that its filter predicts."""

from dataclasses import replace

import numpy as np
import pytest
from continuum.__main__ import out_and_back, rms, split, static_model, table, to_rows
from continuum.prediction import (
    MODELS,
    OFFSET_DEVIATION,
    WITHOUT,
    predict,
    products,
    recursive_least_squares,
    settings,
)
from continuum.robot import (
    FILE,
    PRIOR,
    Record,
    by_geometry,
    fit,
    from_vector,
    read,
    tip_jacobian,
    tip_of_bends,
)
from tautscope.config import Config, DofEntry, KinematicsConfig
from tautscope.loop.kinematics import Segments

FILTER = "kinematics with correction, filter"


def drawn(rows: int, seed: int = 3) -> Record:
    """A record of a robot that is not quite as its drawing, with slack tendons and noise."""
    rng = np.random.default_rng(seed)
    robot = from_vector(by_geometry().to_vector() + 0.5 * PRIOR * rng.normal(size=len(PRIOR)))
    phases, times = rng.uniform(0, 2 * np.pi, 9), np.arange(rows)[:, None]
    servos = 3.0 * np.sin(times * np.linspace(0.05, 0.2, 9) + phases) - 1.0
    tip = robot.tip(servos) + rng.normal(0, 1e-4, (rows, 3))
    return Record(servos, tip + robot.place)


@pytest.mark.parametrize("share", [1.0, WITHOUT])
def test_settings_are_accepted(share: float) -> None:
    assert settings(share).estimation.offset_deviation * share == pytest.approx(OFFSET_DEVIATION)


def test_tips_of_many_states_are_those_of_the_package() -> None:
    dofs = tuple(DofEntry(name=f"bend_{index}", width_limit=1.0) for index in range(6))
    kinematics = KinematicsConfig(kind="segments", length=0.06, tip_length=0.01)
    package = Segments(Config(dof=dofs, kinematics=kinematics))
    states = np.random.default_rng(0).normal(0, 1, (20, 6))
    states[0] = 0
    expected = [package.tip(state)[0] for state in states]
    np.testing.assert_allclose(tip_of_bends(states, 0.06, 0.01), expected, atol=1e-12)
    slope = tip_jacobian(states[1], 0.06, 0.01) @ states[2]
    ahead, behind = states[1] + 1e-6 * states[2], states[1] - 1e-6 * states[2]
    steps = tip_of_bends(np.stack([ahead, behind]), 0.06, 0.01)
    np.testing.assert_allclose(slope, (steps[0] - steps[1]) / 2e-6, atol=1e-8)


def test_the_fit_finds_a_robot_that_is_not_as_its_drawing() -> None:
    record = drawn(150)
    geometry, fitted = by_geometry(), fit(record, evaluations=8)
    errors = [
        rms(each.to_base(record.tip) - each.tip(record.servos)) for each in (geometry, fitted)
    ]
    assert errors[1] < 0.2 * errors[0]


def test_recursive_regression_is_the_regression_of_all_rows() -> None:
    rng = np.random.default_rng(1)
    regressors, values = rng.normal(size=(40, 5)), rng.normal(size=(40, 3))
    found = recursive_least_squares(regressors, values, std=0.01)[-1]
    prior = np.eye(5) * (5e-3 / 0.01) ** 2
    expected = np.linalg.solve(regressors.T @ regressors + prior, regressors.T @ values)
    np.testing.assert_allclose(found, expected, atol=1e-10)
    assert products(np.zeros((2, 9))).shape == (2, 55)


@pytest.mark.parametrize("model", [each for each in MODELS if "without" not in each])
def test_no_prediction_uses_what_comes_later(model: str) -> None:
    record, changed_from, delay = drawn(20), 16, 5
    servos, tip = record.servos.copy(), record.tip.copy()
    servos[changed_from:] += 1.0
    tip[changed_from:] += 0.05
    # The tip of a row is seen `delay` rows later.
    tip[changed_from - delay + 1 :] += 0.05
    robot = by_geometry()
    before = predict(robot, record, model, delay).tip
    after = predict(robot, Record(servos, tip), model, delay).tip
    np.testing.assert_array_equal(before[:changed_from], after[:changed_from])
    assert np.all(np.isnan(before[:delay])) and np.all(np.isfinite(before[delay:]))


def test_the_static_model_does_not_know_the_last_third(monkeypatch: pytest.MonkeyPatch) -> None:
    record, seen = drawn(60), []
    monkeypatch.setattr("continuum.__main__.fit", seen.append)
    static_model(record)
    assert len(seen[0]) == split(record) == 40
    np.testing.assert_array_equal(seen[0].tip, record.tip[:40])


def test_rows_are_errors_of_the_last_third_alone() -> None:
    record, robot = drawn(30), by_geometry()
    perfect = predict(robot, record, "last tip", 1)
    tip = robot.to_base(record.tip)
    tip[:20] = np.nan
    tip[20:, 0] += 2e-3
    (row,) = to_rows(record, robot, {("last tip", 1): replace(perfect, tip=tip)})
    assert row["rms_mm"][1] == pytest.approx(2.0) and row["refused"] == 0


def test_the_table_says_by_how_much_plays_change_the_error() -> None:
    errors = {"filter without plays": (2.0, 4.0, 10.0), "filter": (2.0, 5.0, 9.0)}
    rows = [
        {"model": model, "rms_mm": dict(zip((1, 5, 20), each, strict=True))}
        for model, each in errors.items()
    ]
    known = dict.fromkeys(("static_fitted", "static_last_third", "out_and_back", "pairs"), 7.0)
    shown = table(rows, known)
    assert "| filter | 2.0 | 5.0 | 9.0 |" in shown
    assert "Plays change the error by +0%, +25%, -10% (filter)." in shown


def test_pairs_are_equal_pulls_on_the_way_out_and_back() -> None:
    pulls = np.zeros((9, 9))
    pulls[:, 0] = [0, 1, 2, 3, 4, 3, 2, 1, 0]
    assert out_and_back(pulls, 1) == [(5, 3), (6, 2), (7, 1)]


@pytest.mark.skipif(not FILE.exists(), reason="TAUTSCOPE_DATA has no opencr")
def test_the_filter_predicts_better_than_the_last_tip() -> None:
    record, delay = read(), 5
    part = Record(record.servos[150:250], record.tip[150:250])
    robot = fit(Record(part.servos[:50], part.tip[:50]), evaluations=4)
    tip = robot.to_base(part.tip)
    found = {model: predict(robot, part, model, delay) for model in ("last tip", FILTER)}
    errors = {model: rms((each.tip - tip)[50:]) for model, each in found.items()}
    assert errors[FILTER] < 0.3 * errors["last tip"]
    assert found[FILTER].refused == 0
