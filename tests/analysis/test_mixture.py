"""Prediction at sights: trivial predictors, tracked regression, weighted mixture."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from play_model import play
from tautscope._core import track_coefficients
from tautscope.analysis.comparison import HORIZONS, analyze, seen_at
from tautscope.analysis.models import last_tip, mixture
from tautscope.analysis.models.components import (
    NOISE,
    UNKNOWN,
    Component,
    Refit,
    Signals,
    track,
)
from tautscope.analysis.models.task import Task, continued
from tautscope.config import load_config
from tautscope.errors import SignalError
from tautscope.report.metrics import rms
from tautscope.runs.records import read_record

Floats = NDArray[np.float64]
CONFIG = load_config()


def moving(seed: int, n: int = 2400) -> Floats:
    """A command that wanders between -10 and 10."""
    rng = np.random.default_rng(seed)
    turns = np.concatenate([[0.0], rng.uniform(-10, 10, 24)])
    return np.interp(np.linspace(0, 24, n), np.arange(25), turns)


def task(command: Floats, measured: Floats, gain: float | None = None) -> Task:
    return Task(command, measured, len(command) // 2, gain, None, CONFIG)


@pytest.mark.parametrize("share", HORIZONS)
def test_sights_are_the_share_of_the_range_apart(share: float) -> None:
    command = moving(0)
    measured = np.where(np.arange(len(command)) % 7 == 3, 2 * command, np.nan)
    found = seen_at(task(command, measured), share).measured
    at = np.flatnonzero(np.isfinite(found))
    assert at[0] == 3
    np.testing.assert_array_equal(found[at], measured[at])
    step = share * np.ptp(command)
    for k, following in pairwise(at):
        assert np.abs(np.diff(command[k : following + 1])).sum() >= step * (1 - 1e-6)
        # The measured tip before it came too early.
        assert np.abs(np.diff(command[k : following - 6])).sum() < step


def test_trivial_predictors_and_continued_models_start_from_the_last_tip() -> None:
    command = moving(1, 400)
    tip = play(command, -2.0, 2.0)
    measured = np.where(np.arange(400) % 9 == 4, tip, np.nan)
    record = task(command, measured, gain=0.7)
    last, with_gain = last_tip.run(record).tip, last_tip.run_with_gain(record).tip
    model = np.sin(command)
    shifted = continued(model, measured)
    assert np.isnan(last[:200]).all()
    assert np.isnan(with_gain[:200]).all()
    np.testing.assert_array_equal(shifted[:5], model[:5])
    for k in range(200, 400):
        seen = max(j for j in range(k) if j % 9 == 4)
        assert last[k] == tip[seen]
        assert with_gain[k] == pytest.approx(tip[seen] + 0.7 * (command[k] - command[seen]))
        assert shifted[k] == pytest.approx(tip[seen] + model[k] - model[seen])


def test_the_gain_is_that_of_the_changes_in_the_first_half() -> None:
    command = moving(2)
    measured = 1.7 * command + 40
    measured[1200:] *= -3
    assert last_tip.gain(task(command, measured)) == pytest.approx(1.7)


@pytest.mark.parametrize("walks", [(0.0, 0.0), (0.3, 0.0), (0.05, 0.4)])
def test_a_tracked_regression_is_the_gaussian_conditional_mean(walks: tuple[float, float]) -> None:
    """Coefficients and disturbance are a Gaussian process of the travel; condition on the past."""
    rng = np.random.default_rng(4)
    samples, spread = 40, 0.5
    features = rng.normal(size=(samples, 3))
    travel = np.cumsum(rng.uniform(0, 0.2, samples))
    tips = rng.normal(size=samples)
    at = np.arange(2, samples, 3)
    seen = np.where(np.isin(np.arange(samples), at), tips, np.nan)
    found = track(features, travel, seen, spread=spread, walks=np.array([walks]))[:, 0]
    assert np.isnan(found[:3]).all()
    for k in range(3, samples):
        past = at[at < k]
        # A change of travel after the last tip is unknown, and its mean is zero.
        moved = np.append(travel[past], travel[past[-1]]) - travel[at[0]]
        rows = features[np.append(past, k)]
        common = np.minimum.outer(moved, moved)
        covariance = rows @ rows.T * spread**2 * (1 + walks[1] ** 2 * common)
        covariance += UNKNOWN**2 + walks[0] ** 2 * common
        inner = covariance[:-1, :-1] + NOISE**2 * np.eye(len(past))
        gain = np.linalg.solve(inner, covariance[:-1, -1])
        expected = features[k, 0] + gain @ (tips[past] - features[past, 0])
        assert found[k] == pytest.approx(expected, abs=1e-6)


def test_a_tracked_regression_is_a_kalman_filter_per_random_walk() -> None:
    """Nine filters by the textbook's recursion, the covariance in Joseph's form."""
    rng = np.random.default_rng(8)
    samples, size, spread = 120, 4, 0.5
    features, tips = rng.normal(size=(samples, size)), rng.normal(size=samples)
    travel, at = np.cumsum(rng.uniform(0, 0.2, samples)), np.arange(5, samples, 2)
    walks = np.array([(d, w) for d in (0.0, 0.1, 1.0) for w in (0.0, 0.05, 0.4)])
    seen = np.where(np.isin(np.arange(samples), at), tips, np.nan)
    found = track(features, travel, seen, spread=spread, walks=walks)
    for number, (disturbance, coefficient) in enumerate(walks):
        prior = np.array([spread**2] * size + [UNKNOWN**2])
        walk = np.array([(coefficient * spread) ** 2] * size + [disturbance**2])
        x, covariance, last = np.eye(size + 1)[0], np.diag(prior), travel[at[0]]
        for k in range(samples):
            row = np.append(features[k], 1.0)
            if k > at[0]:
                assert found[k, number] == pytest.approx(row @ x, abs=1e-8), (k, walks[number])
            if k in at:
                covariance = covariance + np.diag(walk) * (travel[k] - last)
                gain = covariance @ row / (row @ covariance @ row + NOISE**2)
                x = x + gain * (tips[k] - row @ x)
                rest = np.eye(size + 1) - np.outer(gain, row)
                covariance = rest @ covariance @ rest.T + NOISE**2 * np.outer(gain, gain)
                last = travel[k]


@pytest.mark.parametrize(
    ("name", "allowed"),
    [("travel", "one per sample"), ("measured", "one per sample"), ("mean", "per coefficient")],
)
def test_a_tracked_regression_names_an_array_of_the_wrong_length(name: str, allowed: str) -> None:
    arrays = {"travel": np.zeros(5), "measured": np.zeros(5), "mean": np.zeros(2)}
    arrays[name] = np.zeros(3)
    more = {"variance": np.ones(2), "growth": np.ones((1, 2)), "noise": 1.0}
    with pytest.raises(SignalError, match=rf"{name}: got '3 values', expected .* {allowed}"):
        track_coefficients(np.ones((5, 2)), **arrays, **more)


@pytest.mark.parametrize("block", [7, 4096])
def test_the_mixture_is_the_formula_written_out(
    monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    """Sums over all past tips, with tips at every third sample, and errors that a fit replaces."""
    monkeypatch.setattr(mixture, "BLOCK", block)
    rng = np.random.default_rng(9)
    samples, count = 150, 20
    tips = np.where(np.arange(samples) % 3 == 1, rng.normal(size=samples), np.nan)
    signals = Signals(moving(9, samples), tips)
    variants = np.nan_to_num(tips)[:, None] + rng.normal(0, [0.1, 0.2, 0.3], (samples, 3))
    refit = Refit(count, 4, rng.normal(0, 0.05, (count, 2)))
    components = [Component("a", variants[:, :1]), Component("b", variants[:, 1:], [refit])]
    found, shares = mixture.mix(components, signals)
    errors = (variants - tips[:, None])[signals.at]

    def weights(past: Floats, memory: float) -> Floats:
        discounts = memory ** np.arange(len(past))[::-1]
        losses = discounts @ (past**2 + mixture.FLOOR**2)
        power = losses ** (-discounts.sum() / 2)
        return power / power.sum()

    totals, mixed, each = {}, [], np.full((len(mixture.MEMORIES), 3), 1 / 3)
    for j in range(1, len(errors)):
        mixed.append(each @ errors[j])
        if j + 1 == count:
            errors[:count, 1:] = refit.errors
        first = 4 if j + 1 >= count else 1
        each = np.array([weights(errors[first : j + 1], b) for b in mixture.MEMORIES])
        totals[j] = weights(np.array(mixed), mixture.SECOND_MEMORY) @ each
    assert np.isnan(found[: signals.at[1] + 1]).all()
    for k in range(signals.at[1] + 1, samples):
        total = totals[max(j for j in totals if signals.at[j] < k)]
        assert found[k] == pytest.approx(total @ variants[k], rel=1e-9), k
        assert shares["b"][k] == pytest.approx(total[1:].sum(), rel=1e-9), k


def test_weights_are_posterior_probabilities() -> None:
    """Constant errors 1 and 2: after N tips, memory b, the odds are 2^N_b."""
    command = moving(5, 30)
    signals = Signals(command, np.zeros(30))
    components = [Component(f"{size}", np.full((30, 1), size)) for size in (1.0, 2.0)]
    tip, weights = mixture.mix(components, signals)
    for k in (2, 5, 29):
        powers = [sum(b**j for j in range(k - 1)) for b in mixture.MEMORIES]
        shares = np.array([2**n / (1 + 2**n) for n in powers])  # of the smaller error
        mixed = shares + 2 * (1 - shares)
        assert mixed.min() - 1e-5 <= tip[k] <= mixed.max() + 1e-5
        assert weights["1.0"][k] == pytest.approx(2 - tip[k])
        assert weights["1.0"][k] + weights["2.0"][k] == pytest.approx(1)
    assert weights["1.0"][29] > 2**5 / (1 + 2**5)  # five tips: the shortest memory


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("share", HORIZONS)
def test_the_mixture_finds_the_model_of_the_record(seed: int, share: float) -> None:
    command, noise = moving(seed), np.random.default_rng(seed).normal(0, 0.02, 2400)
    measured = -3 * play(command, -1.0, 2.0) + 50 + noise
    record = seen_at(task(command, measured), share)
    error = rms((mixture.run(record).tip - measured)[1200:])
    assert error < 0.3, f"seed {seed}"  # the width is 9, the range about 50
    trivial = [last_tip.run(record).tip, last_tip.run_with_gain(record).tip]
    assert error < 0.7 * min(rms((tip - measured)[1200:]) for tip in trivial), f"seed {seed}"


@pytest.mark.parametrize(
    "unrelated",
    [
        lambda rng: np.cumsum(rng.normal(size=2400)),
        lambda rng: np.repeat(rng.normal(size=24), 100),
    ],
    ids=["random walk", "jumps"],
)
def test_a_tip_that_no_model_explains_costs_little(
    unrelated: Callable[[np.random.Generator], Floats],
) -> None:
    command, measured = moving(6), unrelated(np.random.default_rng(6))
    record = seen_at(task(command, measured), 0.03)
    error, last = (rms((m.run(record).tip - measured)[1200:]) for m in (mixture, last_tip))
    assert error < 1.1 * last


@pytest.mark.parametrize("share", HORIZONS[:2])
def test_a_changed_slack_is_followed_within_two_strokes(share: float) -> None:
    command = 10 * np.sin(np.linspace(0, 24 * np.pi, 3600))  # 24 strokes of 150 samples
    noise = np.random.default_rng(7).normal(0, 0.01, 3600)
    narrow, wide = play(command, -1.0, 1.0), play(command, -3.0, 1.5)
    measured = np.where(np.arange(3600) < 2400, narrow, wide) + noise
    error = mixture.run(seen_at(task(command, measured), share)).tip - measured
    strokes = [rms(error[2400 + k : 2550 + k]) for k in range(75, 1200, 150)]
    assert max(strokes[2:]) < 0.15 * (4.5 - 2)


def test_the_mixture_is_at_most_5_percent_worse_than_any_model_on_a_real_tool(
    tool_folder: Path,
) -> None:
    found = analyze(read_record(tool_folder / "tool4_R5_run10.csv", "motor_deg", "jaw_deg"), CONFIG)
    errors = {entry.model.name: entry.horizons for entry in found.entries}
    best = errors.pop("best")
    for at, share in enumerate(HORIZONS):
        others = {
            name: np.nanmin([horizons[at].rmse, horizons[at].alone])
            for name, horizons in errors.items()
        }
        assert best[at].rmse <= 1.05 * min(others.values()), f"{share:.0%}: {others}"
