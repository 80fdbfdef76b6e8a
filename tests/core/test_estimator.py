"""The estimator on a record: causal prediction, offsets, triggers."""

import numpy as np
import pytest
from tautscope import _core
from tautscope.config import Config


def record(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    command = np.cumsum(rng.normal(0.0, 1e-3, 4000))
    play = _core.Play(delta_minus=-3e-3, delta_plus=5e-3)
    return command, play.run(command) + rng.normal(0.0, 1e-5, command.size)


def new_estimator() -> _core.Estimator:
    names = ("update_distance", "contact_tolerance", "smoothing_factor")
    settings = {name: getattr(Config().insertion, name) for name in names}
    return _core.Estimator(**settings, delta_minus=0.0, delta_plus=0.0)


@pytest.mark.parametrize("seed", range(3))
def test_run_equals_predict_then_update(seed: int) -> None:
    command, measured = record(seed)
    predicted, minus, plus = new_estimator().run(command, measured)
    estimator = new_estimator()
    for k, (c, m) in enumerate(zip(command, measured, strict=True)):
        assert predicted[k] == estimator.predict(c)
        estimator.update(c, m)
        assert (minus[k], plus[k]) == (estimator.delta_minus, estimator.delta_plus), f"seed {seed}"


@pytest.mark.parametrize("seed", range(3))
def test_a_prediction_uses_the_past_only(seed: int) -> None:
    command, measured = record(seed)
    changed = measured.copy()
    changed[2000:] += 1.0
    before, after = (
        new_estimator().run(command, measured)[0],
        new_estimator().run(command, changed)[0],
    )
    np.testing.assert_array_equal(before[:2001], after[:2001], err_msg=f"seed {seed}")
    assert not np.allclose(before[2001:], after[2001:])


@pytest.mark.parametrize("seed", range(3))
def test_the_prediction_is_better_than_the_command(seed: int) -> None:
    command, measured = record(seed)
    predicted, minus, plus = new_estimator().run(command, measured)
    last = slice(2000, None)
    error = np.abs(predicted - measured)[last].mean()
    assert error < 0.1 * np.abs(command - measured)[last].mean(), f"seed {seed}"
    assert minus[-1] == pytest.approx(-3e-3, abs=2e-4), f"seed {seed}"
    assert plus[-1] == pytest.approx(5e-3, abs=2e-4), f"seed {seed}"


def test_triggers_are_named() -> None:
    estimator = new_estimator()
    assert estimator.update(0.0, 0.0) == (None, None)
    assert estimator.update(0.01, 0.0) == (None, "violation")
    assert estimator.update(0.02, 0.01) == (None, "contact")
    assert estimator.update(0.0, 0.01) == ("violation", None)
