"""Figures of merit, on signals with a known result."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray
from play_model import play
from tautscope.errors import SignalError
from tautscope.report import metrics

TWO_PERIODS = np.linspace(0, 4 * np.pi, 4001)


def settled_loop(
    amplitude: float, delta_minus: float, delta_plus: float, centre: float = 0.0
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    x = centre + amplitude * np.sin(np.linspace(0, 6 * np.pi, 6001))
    y = play(x, delta_minus, delta_plus)
    return x[2000:], y[2000:]


@given(
    amplitude=st.floats(0.01, 100),
    slack=st.floats(0.01, 0.8),
    offset=st.floats(-5, 5),
    centre=st.floats(-10, 10),
)
@settings(max_examples=60, deadline=None)
def test_width_of_a_play_is_the_difference_of_its_offsets(
    amplitude: float, slack: float, offset: float, centre: float
) -> None:
    width = 2 * amplitude * slack
    x, y = settled_loop(amplitude, offset, offset + width, centre)
    loop = metrics.loop_width(x, y)
    assert loop.mean == pytest.approx(width, rel=1e-3)
    assert loop.max == pytest.approx(width, rel=3e-3)
    assert float(loop) == loop.mean


@given(scale=st.floats(0.1, 10), shift=st.floats(-5, 5), other=st.floats(-5, 5))
@settings(max_examples=40, deadline=None)
def test_width_scales_with_the_input_and_ignores_shifts(
    scale: float, shift: float, other: float
) -> None:
    x, y = settled_loop(1.0, -0.3, 0.2)
    plain = metrics.loop_width(x, y)
    moved = metrics.loop_width(scale * x + shift, 3 * scale * y + other)
    assert moved.mean == pytest.approx(scale * plain.mean, rel=1e-6)
    assert moved.max == pytest.approx(scale * plain.max, rel=1e-6)


def test_a_leading_output_has_a_negative_width() -> None:
    x, y = settled_loop(1.0, -0.2, 0.2)
    ahead = metrics.loop_width(y, x)
    assert ahead.mean < 0
    assert metrics.loop_width(x, x).mean == pytest.approx(0, abs=1e-12)


def test_the_largest_width_counts_both_directions() -> None:
    """A loop that crosses itself: it leads by more at the bottom than it lags at the top."""
    y = np.sin(TWO_PERIODS)
    loop = metrics.loop_width(y + np.sign(np.cos(TWO_PERIODS)) * (0.2 * y - 0.1), y)
    widths = 0.4 * loop.levels - 0.2
    np.testing.assert_allclose(loop.widths, widths, atol=1e-3)
    assert loop.max == pytest.approx(widths.min(), abs=1e-3)


def test_a_repeated_sample_changes_nothing() -> None:
    x, y = settled_loop(1.0, -0.2, 0.4)
    plain = metrics.loop_width(x, y)
    repeated = metrics.loop_width(np.repeat(x, 3), np.repeat(y, 3))
    np.testing.assert_allclose(repeated.widths, plain.widths, rtol=0, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_noise_in_the_output_does_not_close_the_loop(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = settled_loop(15.0, -5.0, 5.0)
    noisy = metrics.loop_width(x, y + rng.normal(0, 0.15, len(y)))
    assert noisy.mean == pytest.approx(10.0, abs=0.2), f"seed {seed}"
    assert noisy.max < 11.0, f"seed {seed}"


def test_uneven_width_shows_as_maximum() -> None:
    """An ellipse is widest in the middle: y = sin(t), x = sin(t + lag)."""
    lag = 0.3
    loop = metrics.loop_width(np.sin(TWO_PERIODS + lag), np.sin(TWO_PERIODS))
    level = np.linspace(-0.8, 0.8, 41)
    np.testing.assert_allclose(loop.widths, 2 * np.sin(lag) * np.sqrt(1 - level**2), atol=1e-5)
    assert loop.max == pytest.approx(2 * np.sin(lag), abs=1e-5)


@pytest.mark.parametrize(
    ("x", "y"),
    [
        (TWO_PERIODS, np.zeros_like(TWO_PERIODS)),
        (TWO_PERIODS, TWO_PERIODS),
        (TWO_PERIODS, np.full_like(TWO_PERIODS, np.nan)),
        ([], []),
    ],
    ids=["still", "one way", "unknown", "empty"],
)
def test_a_signal_without_a_loop_has_no_width(x: ArrayLike, y: ArrayLike) -> None:
    loop = metrics.loop_width(x, y)
    assert math.isnan(loop.mean)
    assert math.isnan(loop.max)


def test_signals_of_different_length_are_an_error() -> None:
    with pytest.raises(SignalError, match="y: got '3 samples', expected as many as x: 2"):
        metrics.loop_width([0, 1], [0, 1, 2])
    with pytest.raises(SignalError, match="x: got"):
        metrics.loop_width([[0, 1]], [0, 1])


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda: metrics.tip_overspeed(np.arange(3), np.zeros(9), np.zeros(9)), "time"),
        (lambda: metrics.marker_errors(np.zeros(4), np.zeros(4)), "measured"),
        (lambda: metrics.marker_errors(np.zeros((3, 4)), np.zeros((2, 4))), "truth"),
        (lambda: metrics.marker_rms(np.zeros((3, 2)), np.zeros((3, 2))), "measured"),
        (lambda: metrics.creep(np.zeros((5, 3)), np.zeros((5, 2))), "references"),
        (lambda: metrics.creep(np.zeros((5, 3)), 0.0), "references"),
        (
            lambda: metrics.period_widths(
                np.arange(9.0), np.zeros(99), np.zeros(99), start=0, period=2, periods=3
            ),
            "time",
        ),
    ],
)
def test_arrays_that_do_not_fit_are_named(call: Callable[[], object], field: str) -> None:
    with pytest.raises(SignalError) as caught:
        call()
    assert caught.value.field == field


def test_reduction_is_the_share_removed() -> None:
    assert metrics.reduction(10.0, 2.5) == pytest.approx(0.75)
    assert math.isnan(metrics.reduction(0.0, 1.0))
    assert metrics.reduction(10.0, -9.0) == metrics.reduction(10.0, 9.0)
    loop = metrics.loop_width(*settled_loop(1.0, -0.2, 0.2))
    assert metrics.reduction(loop, loop) == 0


@pytest.mark.parametrize(
    ("widths", "expected"),
    [
        ([1, 1, 1], 0),
        ([9, 1.1, 1], 1),
        ([1, 9, 1.1, 1], 2),
        ([9, 8, 7, 6, 1], 4),
        ([math.nan, 1, 1], 1),
        ([-1, -1], 0),
        ([-9, 1, -1], 1),
    ],
)
def test_start_counts_the_periods_before_the_settled_ones(
    widths: list[float], expected: float
) -> None:
    assert metrics.start_periods(widths) == expected


def test_start_of_an_unknown_end_is_unknown() -> None:
    assert math.isnan(metrics.start_periods([1.0, math.nan]))
    assert math.isnan(metrics.start_periods([]))


def test_widths_per_period_follow_a_shrinking_play() -> None:
    time = np.arange(5001) * 1e-3
    x = np.sin(2 * np.pi * time)
    y = np.empty_like(x)
    last = 0.0
    for index, value in enumerate(x):
        half = 0.4 if time[index] < 3.25 else 0.1
        last = y[index] = min(max(last, value - half), value + half)
    widths = metrics.period_widths(time, x, y, start=0.0, period=1.0, periods=5)
    np.testing.assert_allclose(widths[[0, 1, 2, 4]], [0.8, 0.8, 0.8, 0.2], rtol=1e-2)
    assert metrics.start_periods(widths) == 4
    whole = [metrics.loop_width(x[k : k + 1001], y[k : k + 1001]) for k in range(0, 5000, 1000)]
    np.testing.assert_array_equal(widths, [loop.mean for loop in whole])


def test_rms_of_a_constant_error_is_that_error() -> None:
    reference = np.sin(TWO_PERIODS)
    assert metrics.tracking_rms(reference, reference - 0.25) == pytest.approx(0.25)
    assert metrics.state_rms([1.0, np.nan, 3.0], [0.0, 0.0, 4.0]) == pytest.approx(1.0)
    assert math.isnan(metrics.state_rms([], []))


def test_overspeed_is_the_ratio_of_speeds() -> None:
    time = TWO_PERIODS
    assert metrics.tip_overspeed(time, np.sin(time), 3 * np.sin(time)) == pytest.approx(3, rel=1e-5)
    assert math.isnan(metrics.tip_overspeed(time, np.zeros_like(time), time))


@given(slack=st.floats(0.05, 0.9), gain=st.floats(1.0, 1.5))
@settings(max_examples=40, deadline=None)
def test_a_lagging_tip_never_overshoots(slack: float, gain: float) -> None:
    """After a reversal it is ahead of the reference, but lags in its own motion."""
    reference, tip = settled_loop(1.0, -slack, slack)
    assert metrics.overshoot(reference, tip) == pytest.approx(0, abs=1e-9)
    # Motion beyond the reference within a stroke counts in full.
    assert metrics.overshoot(reference, gain * reference) == pytest.approx(gain - 1, abs=1e-9)


@pytest.mark.parametrize("ahead", [0.1, 0.4])
def test_overshoot_is_the_largest_lead(ahead: float) -> None:
    """A play whose offsets have changed sign leads by their size, once it has moved that far."""
    reference, tip = settled_loop(1.0, -ahead, ahead)
    assert metrics.overshoot(tip, reference) == pytest.approx(ahead, rel=1e-3)
    assert metrics.overshoot(-tip, -reference) == pytest.approx(ahead, rel=1e-3)


def test_overshoot_without_motion_or_of_unknown_values() -> None:
    assert math.isnan(metrics.overshoot([1.0, 1.0], [0.0, 1.0]))
    assert math.isnan(metrics.overshoot([], []))
    assert math.isnan(metrics.overshoot([0.0, 1.0, 2.0], [0.0, np.nan, 2.0]))
    assert math.isnan(metrics.overshoot([0.0, 1.0, 2.0, 1.0, 0.0], [0.0, np.nan, 2.0, 1.0, 0.0]))
    # A rest inside a stroke does not end it.
    assert metrics.overshoot([0, 1, 1, 2], [0, 1, 1.5, 2]) == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("values", "expected"),
    [([10, 10], 0), ([2, 8, 9.5, 10.5], 2), ([10, 2, 10], 2), ([10, math.nan, 10], 2)],
)
def test_until_within_counts_the_values_before(values: list[float], expected: float) -> None:
    assert metrics.until_within(values, 10.0, 1.0) == expected


def test_until_within_that_is_not_reached_is_unknown() -> None:
    assert math.isnan(metrics.until_within([10, 2], 10.0, 1.0))
    assert math.isnan(metrics.until_within([], 10.0, 1.0))


def test_peak_to_peak() -> None:
    assert metrics.peak_to_peak([1.0, -2.0, 0.5]) == 3.0
    assert math.isnan(metrics.peak_to_peak([]))
    assert math.isnan(metrics.peak_to_peak([1.0, math.nan]))


def test_actuator_gain_is_the_largest_ratio_of_steps() -> None:
    assert metrics.actuator_gain([0, 1, 2, 1], [0, 1, 2, -3]) == pytest.approx(5.0)
    assert metrics.actuator_gain([0, 1, 1.1], [0, 1, 1.7]) == pytest.approx(7.0)
    assert metrics.actuator_gain([0, 1, 1 + 1e-12], [0, 1, 1 + 1e-10]) == pytest.approx(1.0)
    assert metrics.actuator_gain([0, 1, 1], [0, 1, 1.5]) == math.inf
    assert math.isnan(metrics.actuator_gain([0, 0], [0, 0]))


def test_marker_errors_are_distances_per_marker() -> None:
    measured = np.array([[0, 0, 10, 10], [3, 4, 10, 10], [np.nan] * 4], dtype=float)
    truth = np.array([[0, 0, 10, 10]] * 3, dtype=float)
    np.testing.assert_array_equal(metrics.marker_errors(measured[:2], truth[:2]), [[0, 0], [5, 0]])
    assert metrics.marker_rms(measured, truth) == pytest.approx(2.5)


def test_the_largest_error_counts_either_sign_and_skips_unknown_tips() -> None:
    reference, tip = [1.0, 2.0, 3.0, 4.0], [1.5, -1.0, np.nan, 4.0]
    assert metrics.largest_error(reference, tip) == metrics.largest_error(tip, reference) == 3.0
    assert np.isnan(metrics.largest_error([1.0], [np.nan]))


def test_creep_is_the_travel_of_the_tip_while_every_reference_rests() -> None:
    references = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 0], [1, 0, 1], [1, 0, 1], [1, 0, 1]])
    tip = [0.0, 1.0, 1.5, 7.0, 6.5, 7.5]
    assert metrics.creep(references, tip) == pytest.approx(0.5 + 0.5 + 1.0)
    assert np.isnan(metrics.creep(references[:1], tip[:1]))
    unknown = [0.0, 1.0, np.nan, 7.0, np.nan, 7.5]
    assert np.isnan(metrics.creep(references, unknown))
    with pytest.raises(SignalError):
        metrics.creep(references, tip[:-1])
