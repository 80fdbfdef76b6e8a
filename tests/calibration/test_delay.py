"""Delay and drift of clocks on simulated plays, whose delay is known."""

import json

import numpy as np
import pytest
from numpy.typing import NDArray
from play_model import play
from tautscope.calibration.delay import (
    DelayEstimate,
    Probe,
    _combined,
    _move_at_once,
    estimate_delay,
)
from tautscope.calibration.delay_probes import Signal
from tautscope.calibration.tip_states import tip_states
from tautscope.config import load_config
from tautscope.errors import SignalError
from tautscope.log.alignment import implausible_motors
from tautscope.loop.construction import build_feature_model
from tautscope.loop.references import OperatorMotion, SineSequence

Floats = NDArray[np.float64]
WIDTHS = (10e-3, 1.2, 0.6)
NOISE = (5e-5, 0.02, 0.005)
CONFIG = load_config().replace(**{"experiment.periods": 3})


def motors(seed: int | None) -> tuple[Floats, Floats]:
    """Time and positions: sines one after the other, or an operator's motion."""
    experiment = CONFIG.experiment
    reference = SineSequence(experiment) if seed is None else OperatorMotion(experiment, seed, 60.0)
    times = np.arange(0, reference.duration, 0.01)
    return times, np.array([reference(time) for time in times])


def images(
    times: Floats, positions: Floats, delay: float, drift: float, seed: int
) -> tuple[Floats, Floats]:
    """Stamps and tips: 25 images per second, 3 % without a tip, each DOF a play with noise."""
    rng = np.random.default_rng(seed)
    shown = np.arange(0.0, times[-1], 0.04)
    tips = np.stack(
        [
            np.interp(shown, times, play(position, -0.4 * width, 0.6 * width))
            for position, width in zip(positions.T, WIDTHS, strict=True)
        ],
        axis=1,
    )
    tips += rng.normal(size=tips.shape) * NOISE
    tips[rng.uniform(size=len(tips)) < 0.03] = np.nan
    return delay + shown / (1 - drift), tips


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.5, 1.0, 2.4, -1.0])
def test_a_delay_is_found(delay: float) -> None:
    times, positions = motors(None)
    stamps, tips = images(times, positions, delay, 0.0, seed=1)
    found = estimate_delay(times, positions, stamps, tips)
    assert found.is_known, found.reason
    assert found.delay == pytest.approx(delay, abs=0.02)
    assert found.drift == 0
    assert found.delay_std < 0.03
    shown = found.motor_time(stamps, stamps[0])
    np.testing.assert_allclose(shown, stamps - delay, atol=0.02)


@pytest.mark.parametrize("drift", [3e-3, -2e-3])
def test_a_drift_is_found(drift: float) -> None:
    times, positions = motors(None)
    stamps, tips = images(times, positions, 0.4, drift, seed=2)
    found = estimate_delay(times, positions, stamps, tips)
    assert found.is_known, found.reason
    assert found.drift == pytest.approx(drift, rel=0.2)
    true = stamps - 0.4 - drift * (stamps - stamps[0])
    np.testing.assert_allclose(found.motor_time(stamps, stamps[0]), true, atol=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_motions_of_all_dofs_at_once(seed: int) -> None:
    """A wrong answer is worse than none."""
    times, positions = motors(seed)
    stamps, tips = images(times, positions, 0.7, 0.0, seed)
    found = estimate_delay(times, positions, stamps, tips)
    assert found.is_known, f"seed {seed}: {found.reason}"
    assert found.delay == pytest.approx(0.7, abs=0.05), f"seed {seed}"


@pytest.mark.parametrize(("after", "jump"), [(45, 0.5), (45, 1.0), (70, 0.5)])
def test_a_jump_of_the_delay_gives_no_answer(after: float, jump: float) -> None:
    """As of a camera that was opened again."""
    times, positions = motors(None)
    stamps, tips = images(times, positions, 0.0, 0.0, seed=3)
    found = estimate_delay(times, positions, stamps + np.where(stamps > after, jump, 0), tips)
    assert not found.is_known
    assert "delay changes" in found.reason or "disagree" in found.reason
    assert np.isnan(found.delay)


def test_probes_that_disagree_give_no_answer() -> None:
    """The tip stops with its motor, but starts late, as behind a brake."""
    times, positions = motors(None)
    stamps, tips = images(times, positions, 0.0, 0.0, seed=3)
    late = np.stack([np.interp(stamps - 0.8, stamps, tip) for tip in np.nan_to_num(tips).T], axis=1)
    phase = (stamps % 5 + 2.5) % 5  # after a turning point of the sine
    found = estimate_delay(times, positions, stamps, np.where((phase < 2.5)[:, None], late, tips))
    assert not found.is_known


def test_motions_at_once_are_recognised() -> None:
    assert not _move_at_once(*motors(None))
    assert all(_move_at_once(*motors(seed)) for seed in range(3))
    assert not _move_at_once(np.arange(10.0), np.zeros((10, 3)))


@pytest.mark.parametrize(
    ("difference", "std", "at_once", "is_known"),
    [
        (0.08, 0.008, True, False),
        (0.08, 0.008, False, True),
        (0.08, 0.02, True, True),
        (0.2, 0.1, False, False),
    ],
)
def test_probes_that_differ_significantly_where_dofs_move_at_once_give_no_answer(
    difference: float, std: float, at_once: bool, is_known: bool
) -> None:
    model, turning_points = (
        Probe(delay, delay, std, 0.0, 1e-3, 9, 0.01, (1.0, 1.0, 1.0))
        for delay in (0.06, 0.06 + difference)
    )
    found = _combined(model, turning_points, 60.0, at_once=at_once)
    assert found.is_known == is_known
    assert ("one degree of freedom at a time" in found.reason) == (at_once and not is_known)
    assert (found.model, found.turning_points) == (model, turning_points)


def test_a_record_without_a_delay_gives_no_answer() -> None:
    times, positions = motors(0)
    stamps, tips = images(*motors(1), delay=0.0, drift=0.0, seed=4)
    assert not estimate_delay(times, positions, stamps, tips).is_known, "motors of another run"
    at_rest = np.zeros_like(positions)
    assert estimate_delay(times, at_rest, stamps, tips).reason == "no motor moved"
    unseen = np.full_like(tips, np.nan)
    assert "only 0 images" in estimate_delay(times, positions, stamps, unseen).reason


def test_wrong_units_and_signs_are_named() -> None:
    times, positions = motors(None)
    stamps, tips = images(times, positions, 0.2, 0.0, seed=5)
    right = estimate_delay(times, positions, stamps, tips)
    assert list(implausible_motors(right)) == []
    wrong = positions * [1e3, 180 / np.pi, -1.0]
    insertion, rotation, bending = implausible_motors(estimate_delay(times, wrong, stamps, tips))
    assert insertion.endswith("if the positions are in mm, type --units insertion=mm")
    assert rotation.endswith("if the positions are in deg, type --units rotation=deg")
    assert bending.startswith("bending: the tip moves against its motor")


def test_the_tip_is_known_from_an_image_alone() -> None:
    model = build_feature_model(CONFIG)
    rng = np.random.default_rng(6)
    states = rng.uniform([12e-3, -1.8, 0.4], [38e-3, 1.8, 1.7], (30, 3))
    features = np.array([model.predict(state)[0] for state in states])
    features[3] = np.nan
    found = tip_states(features, CONFIG)
    assert np.isnan(found[3]).all()
    kept = np.arange(30) != 3
    np.testing.assert_allclose(found[kept], states[kept], atol=0.02)
    straight = model.predict(np.array([25e-3, 0.5, 0.01]))[0]
    assert np.isnan(tip_states([straight], CONFIG)[0, 1]), "rotation of a straight instrument"


def test_signals_are_checked() -> None:
    times, positions = np.arange(5.0), np.zeros((5, 3))
    with pytest.raises(SignalError, match="stamps: got"):
        estimate_delay(times, positions, times[::-1], positions)
    with pytest.raises(SignalError, match=r"motors: got 'array \(4, 3\)'"):
        estimate_delay(times, positions[1:], times, positions)
    with pytest.raises(SignalError, match="finite positions"):
        estimate_delay(times, positions + np.nan, times, positions)
    for index, name in enumerate(("times", "motors", "stamps", "tips")):
        arrays: list[object] = [times, positions, times, positions]
        for wrong in (["a"], [[1.0], [1.0, 2.0]]):
            arrays[index] = wrong
            with pytest.raises(SignalError, match=f"^{name}: got"):
                estimate_delay(*arrays)
    for limit in (0.0, -1.0, np.nan, np.inf, "a"):
        with pytest.raises(SignalError, match=r"^limit: got"):
            estimate_delay(times, positions, times, positions, limit)
    for features in ("x", np.zeros((3, 3)), np.zeros(4)):
        with pytest.raises(SignalError, match=r"^features: got"):
            tip_states(features, CONFIG)
    with pytest.raises(SignalError, match=r"^stamps: got"):
        DelayEstimate(0.1).motor_time(["a"], 0.0)


def test_no_more_positions_are_used_than_said(monkeypatch: pytest.MonkeyPatch) -> None:
    times, positions = motors(None)
    stamps, tips = images(times, positions, 0.1, 0.0, seed=1)
    used: list[int] = []

    def signal(times: Floats, *others: object) -> Signal:
        used.append(len(times))
        return Signal(times, *others)

    monkeypatch.setattr("tautscope.calibration.delay.Signal", signal)
    monkeypatch.setattr("tautscope.calibration.delay.MOST_POSITIONS", len(times) * 2 // 3)
    assert estimate_delay(times, positions, stamps, tips).is_known
    assert max(used) <= len(times) * 2 // 3


def test_the_result_is_json_where_a_motor_rests() -> None:
    """The gain of the DOF that did not move is unknown, and JSON has no NaN."""
    times, positions = motors(None)
    positions[:, 1] = positions[0, 1]
    stamps, tips = images(times, positions, 0.3, 0.0, seed=1)
    found = estimate_delay(times, positions, stamps, tips)
    assert found.model is not None and np.isnan(found.model.gains[1])
    document = json.loads(json.dumps(found.to_json(), allow_nan=False))
    assert document["model"]["gains"][1] is None
    assert document["model"]["gains"][0] == found.model.gains[0]
    unknown = estimate_delay(times, positions[:, [0, 0, 0]] * 0, stamps, tips).to_json()
    assert (unknown["delay"], unknown["is_known"]) == (None, False)
