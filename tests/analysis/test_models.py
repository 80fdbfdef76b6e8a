"""Models of hysteresis: properties, independent oracles, recovered parameters."""

from dataclasses import replace
from itertools import pairwise
from runpy import run_path

import numpy as np
import pytest
from drawn import EXAMPLES
from numpy.typing import NDArray
from play_model import play
from scipy.integrate import solve_ivp
from tautscope.analysis.comparison import analyze
from tautscope.analysis.models import bouc_wen, constant_play, prandtl_ishlinskii
from tautscope.analysis.models.bouc_wen import BoucWen, hysteretic_variable
from tautscope.analysis.models.prandtl_ishlinskii import PrandtlIshlinskii
from tautscope.analysis.models.registry import MODELS, Model
from tautscope.analysis.models.task import Task, essential
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.report.metrics import rms
from tautscope.runs.records import Cleaning, Record

Floats = NDArray[np.float64]

PI = PrandtlIshlinskii(
    radii=(0.0, 1.5, 4.0, 6.0), weights=(0.2, 0.0, 0.5, 0.3), direction=1.0, offset=0.0
)
BOUC_WEN = BoucWen(
    gain=1.2, hysteresis=-4.0, offset=3.0, rho=0.4, sigma=0.9, exponent=1.6, start=0.0
)
models = pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)


def two_sines(n: int = 2400) -> Floats:
    time = np.linspace(0, 60, n)
    return 12 * np.sin(2 * np.pi * time / 10) + 4 * np.sin(2 * np.pi * time / 3.7)


def resample(command: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """The command with more, uneven samples, and the indices of the old samples."""
    rng = np.random.default_rng(5)
    extra = np.sort(rng.uniform(0, len(command) - 1, 3 * len(command)))
    at = np.unique(np.concatenate([np.arange(len(command)), extra]))
    return np.interp(at, np.arange(len(command)), command), np.flatnonzero(at == np.floor(at))


def sweep_end(command: Floats) -> int:
    """First sample at which the command has crossed nine tenths of its range."""
    span = 0.9 * (command.max() - command.min())
    return next(k for k in range(len(command)) if np.ptp(command[: k + 1]) >= span)


def task(command: Floats, measured: Floats, gain: float | None = None) -> Task:
    return Task(command, measured, len(command) // 2, gain, None, load_config())


@pytest.mark.parametrize(
    "predict",
    [PI.predict, BOUC_WEN.predict, constant_play.ConstantPlay(1.5, -3.0, 4.0, 0.0).predict],
    ids=["prandtl_ishlinskii", "bouc_wen", "play"],
)
def test_sampling_does_not_matter(predict) -> None:
    command = two_sines(300)
    more, at = resample(command)
    np.testing.assert_allclose(predict(more)[at], predict(command), atol=2e-5)
    twice = np.repeat(command, 2)  # a constant command changes nothing
    np.testing.assert_array_equal(predict(twice)[1::2], predict(twice)[::2])


def test_prandtl_ishlinskii_is_odd() -> None:
    command = two_sines()
    np.testing.assert_allclose(PI.predict(-command), -PI.predict(command), atol=1e-12)


def test_prandtl_ishlinskii_with_one_operator_is_a_play() -> None:
    command = two_sines()
    one = PrandtlIshlinskii((2.5,), (1.0,), 1.0, 0.0)
    expected = play(command, -2.5, 2.5, start=command[0])
    np.testing.assert_allclose(one.predict(command), expected, atol=1e-12)


def test_prandtl_ishlinskii_has_the_initial_loading_curve_of_its_weights() -> None:
    rise = np.linspace(0, 10, 101)
    expected = sum(w * np.maximum(rise - r, 0) for w, r in zip(PI.weights, PI.radii, strict=True))
    np.testing.assert_allclose(PI.predict(rise), expected, atol=1e-12)


@pytest.mark.parametrize(
    ("rho", "sigma", "exponent"), [(0.5, 1, 1), (0.8, 0.5, 2.5), (0.3, 2, 1.3), (1.0, 0.7, 6)]
)
def test_bouc_wen_agrees_with_an_integrator(rho: float, sigma: float, exponent: float) -> None:
    turns = [0.0, 5.0, -4.0, 1.0, -2.0, 12.0, 11.0]
    command = np.concatenate([np.linspace(a, b, 9)[:-1] for a, b in pairwise(turns)])
    found = hysteretic_variable(command, rho, sigma, exponent, 0.1)
    expected = [0.1]
    for begin, end in pairwise(command):
        side = np.sign(end - begin)

        def slope(_, w, side=side):
            power = np.abs(w) ** exponent
            return rho * (1 - sigma * side * power * np.sign(w) + (sigma - 1) * power)

        solution = solve_ivp(slope, (begin, end), [expected[-1]], rtol=1e-9, atol=1e-11)
        expected.append(solution.y[0, -1])
    np.testing.assert_allclose(found, expected, atol=3e-5)


def test_bouc_wen_has_dahls_closed_form() -> None:
    travel = np.linspace(0, 20, 201)
    rise = hysteretic_variable(travel, 0.3, 1.0, 1.0, -1.0)
    np.testing.assert_allclose(rise, 1 - 2 * np.exp(-0.3 * travel), atol=1e-5)


@pytest.mark.parametrize("sigma", [0.5, 1.0, 3.0])
def test_bouc_wen_has_a_limit_loop(sigma: float) -> None:
    command = 8 * np.sin(np.linspace(0, 8 * np.pi, 1601))  # 400 samples a period
    from_below = hysteretic_variable(command, 0.5, sigma, 1.7, -1.0)
    from_above = hysteretic_variable(command, 0.5, sigma, 1.7, 1.0)
    last, before = slice(1200, 1600), slice(800, 1200)
    np.testing.assert_allclose(from_below[last], from_above[last], atol=1e-4)
    np.testing.assert_allclose(from_below[last], from_below[before], atol=1e-4)
    np.testing.assert_allclose(from_below[1200:1400], -from_below[1400:1600], atol=1e-4)
    assert np.abs(from_below).max() <= 1
    mirrored = hysteretic_variable(-command, 0.5, sigma, 1.7, 1.0)
    np.testing.assert_array_equal(mirrored, -from_below)


def test_bouc_wen_with_a_sharp_corner_is_a_play() -> None:
    command, radius = two_sines(), 3.0
    sharp = BoucWen(1.0, -radius, 0.0, 1 / radius, 0.5, 400.0, 0.0)
    expected = play(command, -radius, radius, start=command[0])
    np.testing.assert_allclose(sharp.predict(command), expected, atol=0.02 * radius)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("gain", [1.0, -0.02, 700.0])
def test_gain_and_offsets_of_a_play_are_recovered(seed: int, gain: float) -> None:
    command = two_sines()[100:]
    tip = gain * play(command, -5.0, 3.0) + 40 * gain
    noise = np.random.default_rng(seed).normal(0, 0.1 * abs(gain), len(tip))
    found = constant_play.fit(command, tip + noise)
    assert found.gain == pytest.approx(gain, rel=0.01), f"seed {seed}"
    assert found.width == pytest.approx(8 * abs(gain), rel=0.01), f"seed {seed}"
    low, high = sorted([-5.0 * gain, 3.0 * gain])
    assert found.delta_minus == pytest.approx(low - 40 * gain, rel=0.01), f"seed {seed}"
    assert found.delta_plus == pytest.approx(high - 40 * gain, rel=0.01), f"seed {seed}"
    late = slice(400, None)  # after one sweep the start is forgotten
    assert rms((found.predict(command) - tip)[late]) < 0.02 * abs(gain), f"seed {seed}"


@pytest.mark.parametrize("fit", [constant_play.fit, prandtl_ishlinskii.fit, bouc_wen.fit])
def test_motion_before_the_record_does_not_affect_a_fit(fit) -> None:
    command = two_sines(1200)
    measured = play(command, -5.0, 3.0)
    late = sweep_end(command)
    other = measured.copy()
    other[:late] += 2
    assert fit(command, other) == fit(command, measured)
    other[late] += 2
    assert fit(command, other) != fit(command, measured)


def test_plays_need_only_the_essential_samples() -> None:
    """Moves to random targets, the last ones with rests, and a tip at every 40th sample."""
    rng = np.random.default_rng(10)
    turns = rng.uniform(-10, 10, 80)
    turns = np.append(turns, np.repeat(turns[:10], 2))
    command = np.interp(np.linspace(0, 99, 4001), np.arange(100), turns)
    measured = np.where(np.arange(4001) % 40 == 7, command, np.nan)
    fewer, tips = essential(command, measured)
    assert len(fewer) < 400
    for radius in (0.0, 0.5, 3.0, 8.0):
        outputs = play(fewer, -radius, radius, start=1.0)[np.isfinite(tips)]
        expected = play(command, -radius, radius, start=1.0)[np.isfinite(measured)]
        np.testing.assert_array_equal(outputs, expected)


def test_a_record_of_one_stroke_is_fitted_whole() -> None:
    command = np.linspace(0, 20, 300)
    measured = play(command, -2.0, 2.0, start=0.0)
    found = constant_play.fit(command, measured)
    assert rms(found.predict(command) - measured) < 0.02


def test_a_plays_given_gain_is_kept() -> None:
    command = two_sines()
    assert constant_play.fit(command, play(command, -5.0, 3.0), gain=0.9).gain == 0.9


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_weights_of_prandtl_ishlinskii_are_recovered(direction: float) -> None:
    command = two_sines()
    truth = replace(PI, direction=direction, offset=-7.0)
    noise = np.random.default_rng(1).normal(0, 0.05, len(command))
    found = prandtl_ishlinskii.fit(command, truth.predict(command) + noise, radii=PI.radii)
    assert found.direction == direction
    assert found.offset == pytest.approx(-7, abs=0.02)
    np.testing.assert_allclose(found.weights, PI.weights, atol=0.01)
    assert min(found.weights) >= 0


def test_offset_of_prandtl_ishlinskii_is_that_of_least_squares() -> None:
    command = two_sines()
    radii = (0.0, 4.0, 6.0)
    noise = np.random.default_rng(1).normal(0, 0.05, len(command))
    measured = PI.predict(command) + noise + 2.0
    found = prandtl_ishlinskii.fit(command, measured, radii=radii)
    plays = [play(command, -r, r, start=command[0]) for r in radii]
    columns = np.column_stack([*plays, np.ones(len(command))])
    late = sweep_end(command)
    expected = np.linalg.lstsq(columns[late:], measured[late:])[0]
    assert min(expected[:3]) > 0, "a bound is active"
    np.testing.assert_allclose([*found.weights, found.offset], expected, atol=1e-9)


def test_parameters_of_bouc_wen_are_recovered() -> None:
    command = two_sines()
    found = bouc_wen.fit(command, BOUC_WEN.predict(command))
    for name in ("gain", "hysteresis", "offset", "rho", "sigma", "exponent"):
        assert getattr(found, name) == pytest.approx(getattr(BOUC_WEN, name), rel=0.02), name


def test_bouc_wen_keeps_the_turns_between_sparse_tips_of_a_long_record() -> None:
    command = two_sines(12_000)
    truth = BOUC_WEN.predict(command)
    sparse = np.where(np.arange(len(command)) % 150 == 7, truth, np.nan)
    assert rms(bouc_wen.fit(command, sparse).predict(command) - truth) < 0.02


def test_bouc_wen_predicts_the_second_half() -> None:
    command = two_sines()
    truth = BOUC_WEN.predict(command)
    noisy = truth + np.random.default_rng(2).normal(0, 0.2, len(truth))
    prediction = bouc_wen.run(task(command, noisy))
    assert rms((prediction.tip - truth)[1200:]) < 0.04


@models
def test_units_zero_and_direction_do_not_matter(model: Model) -> None:
    """Command in motor steps, reversed, and tip in another unit give the same error."""
    command = two_sines(1200)
    measured = play(command, -5.0, 3.0) + np.random.default_rng(3).normal(0, 0.1, len(command))
    plain = model.run(task(command, measured)).tip
    other = model.run(task(-200 * command + 3e4, 0.05 * measured - 8)).tip
    np.testing.assert_allclose((other[600:] + 8) / 0.05, plain[600:], atol=0.03)


@models
def test_a_model_uses_only_the_samples_it_may(model: Model) -> None:
    command = two_sines(1200)
    measured = play(command, -5.0, 3.0) + 0.1 * np.sin(np.arange(len(command)))
    at = 900
    changed = measured.copy()
    changed[at:] += 5
    before = model.run(task(command, measured)).tip
    after = model.run(task(command, changed)).tip
    if model.fitted_to == "whole record":
        assert not np.array_equal(before, after)
    else:
        np.testing.assert_array_equal(after[: at + 1], before[: at + 1])
    if model.fitted_to == "first half" and not model.uses_sights:
        np.testing.assert_array_equal(after, before)
    if model.uses_sights:
        assert not np.array_equal(before[at + 1 :], after[at + 1 :])
        assert np.isnan(before[:600]).all()
        assert np.isfinite(before[600:]).all()


def test_an_on_line_model_with_a_given_gain_predicts_from_the_first_measured_tip() -> None:
    (model,) = (model for model in MODELS if model.name == "paper")
    command = two_sines()
    measured = 2 * play(command, -5.0, 3.0) - 30
    measured[:4] = np.nan
    found = model.run(task(command, measured, gain=2.0))
    np.testing.assert_array_equal(np.isnan(found.tip), np.arange(len(command)) < 5)
    assert found.parameters["gain"] == 2
    assert found.parameters["delta_minus"] == pytest.approx(-10 + 30, abs=0.2)
    assert found.parameters["delta_plus"] == pytest.approx(6 + 30, abs=0.2)


@pytest.mark.parametrize(
    "model",
    [model for model in MODELS if not model.name.startswith("last_tip")],
    ids=lambda model: model.name,
)
def test_sparse_tip_measurements_suffice(model: Model) -> None:
    """The motor is logged at ten times the camera's rate."""
    command = two_sines()
    truth = play(command, -5.0, 3.0)
    measured = np.where(np.arange(len(command)) % 10 == 3, truth, np.nan)
    blind, full = (model.run(task(command, tip)).tip for tip in (measured, truth))
    error, best = (rms((tip - truth)[1200:]) for tip in (blind, full))
    assert error < best + 0.2


@pytest.fixture(scope="module")
def insertion_record() -> Record:
    """Motor and true tip of the twin's insertion, four periods, no images."""
    lines = run_path(str(EXAMPLES / "twin_record.py"))["samples"]
    time, motor, tip = np.array(list(lines(Dof.INSERTION, 4))).T
    return Record(motor, tip, time, np.arange(len(motor)), Cleaning())


def test_every_model_beats_the_linear_fit_on_the_twin(
    insertion_record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bouc_wen, "_STARTS", (15.0,))
    found = analyze(insertion_record, load_config())
    shares = {entry.model.name: found.share(entry) for entry in found.entries}
    assert shares.pop("none") == 1
    assert len(shares) == len(MODELS) - 1
    assert max(shares.values()) < 0.2, shares
    # Friction distributed along the shaft rounds the corners of the loop; a play has sharp ones.
    assert max(shares["prandtl_ishlinskii"], shares["bouc_wen"]) < 0.5 * shares["play"], shares
