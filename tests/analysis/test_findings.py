"""What is wrong with samples is named with its lines, and does not change the result."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from play_model import play
from records.simulated import Simulated, simulate
from scipy.signal import lfilter
from tautscope.analysis.findings import Finding, without_errors
from tautscope.analysis.identification import identify
from tautscope.analysis.verdict import Verdict, judge
from tautscope.runs.records import Cleaning, Record

SEEDS = range(2)


@cache
def judged(kind: str, seed: int) -> Verdict:
    return judge(simulate(kind, seed).record)


def assert_found(truth: Simulated, verdict: Verdict, what: str, seed: int) -> None:
    texts = [str(finding) for finding in verdict.findings]
    assert any(what in text for text in texts), (seed, texts)
    if verdict.found.is_identified:
        assert verdict.found.width.value == pytest.approx(truth.width, rel=0.1), seed


@pytest.mark.parametrize("seed", SEEDS)
def test_sound_records_have_no_findings(seed: int) -> None:
    for kind in ("play", "rounded", "delay only"):
        assert judged(kind, seed).findings == (), kind


@pytest.mark.parametrize("seed", SEEDS)
def test_missing_values_and_outliers_are_left_out(seed: int) -> None:
    truth = simulate("play", seed)
    for value, what in ((-9999.0, "mark missing ones, such as -9999"), (40.0, "left out")):
        tip = truth.record.measured.copy()
        tip[50::100] = value
        verdict = judge(replace(truth.record, measured=tip))
        assert_found(truth, verdict, what, seed)
        assert_found(truth, verdict, "lines 52, 152, 252 and 17 more places", seed)
        assert np.isnan(verdict.record.measured[50::100]).all()


def test_a_long_rest_before_the_motion_is_left_out() -> None:
    record = simulate("play", 0).record
    count = len(record.command) + 100
    rows = np.arange(2, 2 + count + len(record.command))
    rested = replace(
        record,
        command=np.concatenate([np.full(count, record.command[0]), record.command]),
        measured=np.concatenate([np.full(count, record.measured[0]), record.measured]),
        time=None if record.time is None else np.arange(len(rows)) * np.diff(record.time)[0],
        rows=rows,
    )
    verdict, alone = judge(rested), judge(record)
    assert str(verdict.findings[0]) == (
        f"command: {count} samples of rest before the motion, left out (lines 2 to {count + 1})"
    )
    assert verdict.found.width.value == pytest.approx(alone.found.width.value, rel=1e-3)


@pytest.mark.parametrize("value", [-9999.0, -1.0e6, 999.9, 32767.0])
def test_values_that_mark_missing_tips_are_left_out(value: float) -> None:
    record = simulate("play", 1).record
    tip = record.measured.copy()
    is_missing = np.arange(len(tip)) % 100 < 8
    tip[is_missing] = value
    cleaned, [finding] = without_errors(replace(record, measured=tip))
    assert f"such as {value:.6g}" in str(finding)
    tip[is_missing] = np.nan
    np.testing.assert_array_equal(cleaned.measured, tip)


@pytest.mark.parametrize(
    ("period", "low"),
    [(2**16, -(2**15)), (2**16, 0), (2**12, 0), (2**24, 0), (360, -180), (360, 0), (2 * np.pi, 0)],
)
def test_counters_and_angles_of_each_range_are_unwrapped(period: float, low: float) -> None:
    record = simulate("linear", 0).record
    signal = 2.5 * period / np.ptp(record.command) * record.command
    cleaned, [finding] = without_errors(replace(record, command=(signal - low) % period + low))
    assert f"command: wraps at a range of {period:.6g}" in str(finding)
    np.testing.assert_allclose(np.diff(cleaned.command), np.diff(signal), atol=1e-9 * period)


@pytest.mark.parametrize(
    ("turn", "levels"),
    [(turn, [0, 1]) for turn in (360.0, 256.0, 2 * np.pi)]
    + [(360.0, [0, 1, 0, 0.5]), (360.0, [0.002, 0.999])],
)
def test_steps_by_a_whole_turn_are_no_wraps(turn: float, levels: list[float]) -> None:
    """The command rests between them; in the last of these the encoder has noise."""
    time = 0.1 * np.arange(1200)
    command = turn * np.array(levels)[(time // 5).astype(int) % len(levels)]
    if levels[0]:
        command += np.random.default_rng(0).uniform(-1e-3, 1e-3, len(time)) * turn
    record = Record(command, np.roll(command, 5), time, np.arange(len(time)), Cleaning())
    cleaned, findings = without_errors(record)
    assert findings == []
    np.testing.assert_array_equal(cleaned.command, command)


RISE = np.linspace(0, 1, 1500)
ONE_WAY = {
    "ramp": 20 * RISE,
    "ramp down": -20 * RISE,
    "faster and faster": 20 * RISE**2,
    "stairs": 2 * np.floor(10 * RISE),
    "ramp with a ripple below the slack": 20 * RISE + 1.5 * np.sin(60 * RISE),
    "there and back": 20 * (1 - np.abs(2 * RISE - 1)),
}


@pytest.mark.parametrize("command", ONE_WAY.values(), ids=list(ONE_WAY))
def test_motion_in_one_direction_gets_no_settings(command: np.ndarray) -> None:
    time = 40 * RISE
    tip = play(command, -2, 2) + np.random.default_rng(2).normal(0, 0.05, len(time))
    record = replace(simulate("play", 0).record, command=command, measured=tip, time=time,
                     rows=np.arange(len(time)))  # fmt: skip
    verdict = judge(record)
    assert verdict.settings is None
    assert not verdict.found.is_aligned
    assert "the tip reverses" in verdict.text
    assert "Next: record at least ten strokes" in verdict.text


@pytest.mark.parametrize("seed", SEEDS)
def test_wrapped_counters_are_unwrapped(seed: int) -> None:
    truth = simulate("play", seed)
    counts = np.round(4000 * truth.record.command)
    wrapped = (counts + 2**15) % 2**16 - 2**15
    verdict = judge(replace(truth.record, command=wrapped))
    assert_found(truth, verdict, "command: wraps at a range of 65536", seed)
    np.testing.assert_array_equal(np.diff(verdict.record.command), np.diff(counts))


def test_a_noisy_counter_that_wraps_is_unwrapped() -> None:
    """Steps by noise of up to a quarter of the range of the counter."""
    truth = simulate("play", 1)
    noise = np.random.default_rng(1).normal(0, 2**16 / 20, len(truth.record.command))
    counts = np.round(4000 * truth.record.command + noise)
    wrapped = (counts + 2**15) % 2**16 - 2**15
    cleaned, findings = without_errors(replace(truth.record, measured=wrapped))
    assert "tip: wraps at a range of 65536" in str(findings[0])
    np.testing.assert_array_equal(np.diff(cleaned.measured), np.diff(counts))


def test_a_curve_is_named_and_a_line_is_not() -> None:
    """A gain that falls by a third from one end to the other, with and without slack."""
    for kind in ("linear", "play"):
        record = simulate(kind, 3).record
        tip = record.measured - record.measured.mean()
        curved = tip + 0.1 * tip**2 / np.abs(tip).max()
        assert not any("curve" in str(each) for each in judged(kind, 3).findings), kind
        verdict = judge(replace(record, measured=curved))
        assert any("tip: it follows the command in a curve" in str(x) for x in verdict.findings)


def test_more_strokes_are_no_advice_for_a_dead_band() -> None:
    record = simulate("linear", 3).record
    tip = record.measured - record.measured.mean()
    dead = 0.2 * np.ptp(tip)
    verdict = judge(replace(record, measured=np.sign(tip) * np.maximum(np.abs(tip) - dead, 0)))
    assert verdict.settings is None
    assert "more strokes through the curve make the width no clearer" in verdict.text


def test_nothing_drifts_before_the_fit_begins() -> None:
    """Short strokes that the fit leaves out, then nineteen long ones, with noise."""
    time = np.arange(1500) * 0.02
    command = np.where(time < 11, 0.3, 10) * np.sin(2 * np.pi * time / 2)
    tip = play(command, -1, 1) + np.random.default_rng(0).normal(0, 1, len(time))
    assert np.ptp(identify(time, command, tip).drift) < 0.5


def test_the_next_step_is_that_for_what_is_missing() -> None:
    few = judged("play", 0)  # known to ± 14 %
    assert re.search(r"record about \d+ strokes in place of \d+", few.text)
    assert "check that the two columns belong" in judged("random walk", 0).text
    lag = simulate("linear", 2).record
    tip = lfilter([0.05], [1, -0.95], lag.measured - 5)
    verdict = judge(replace(lag, measured=tip))
    assert verdict.settings is None
    assert "at half the speed: a lag shrinks" in verdict.text or verdict.found.is_aligned


@pytest.mark.parametrize("seed", SEEDS)
def test_a_frozen_tip_is_left_out(seed: int) -> None:
    truth = simulate("play", seed)
    tip = truth.record.measured.copy()
    tip[1200:1600] = tip[1200]
    verdict = judge(replace(truth.record, measured=tip))
    assert_found(truth, verdict, "it repeats its last value while the command moves", seed)
    assert np.isnan(verdict.record.measured[1201:1600]).all()
    assert "(lines 1203 to 1601)" in verdict.text


def test_of_repeated_values_only_those_that_the_model_contradicts_are_left_out() -> None:
    """A tip without noise, which repeats its value in every gap, and is frozen once."""
    truth = simulate("play", 1)
    half = truth.width / abs(truth.gain) / 2
    tip = play(truth.record.command, -half, half)
    first = 1200 + int(np.flatnonzero(np.diff(tip[1200:]))[0]) + 1
    tip[first : first + 300] = tip[first]
    verdict = judge(replace(truth.record, measured=tip))
    left_out = np.flatnonzero(np.isnan(verdict.record.measured))
    np.testing.assert_array_equal(left_out, np.arange(first + 1, first + 300))
    assert f"{len(left_out)} samples left out" in verdict.text
    assert verdict.found.width.value == pytest.approx(2 * half, rel=1e-3)


def test_a_frozen_rest_of_the_record_gives_no_confidence() -> None:
    truth = simulate("play", 2)
    tip = truth.record.measured.copy()
    tip[1100:] = tip[1100]
    tip[:1000] = tip[1000]
    tip[:3] += [0.1, 0.2, 0.3]
    verdict = judge(replace(truth.record, measured=tip))
    assert verdict.settings is None


@pytest.mark.parametrize("seed", SEEDS)
def test_saturated_ends_are_named(seed: int) -> None:
    truth = simulate("play", seed)
    half = truth.width / abs(truth.gain) / 2
    exact = play(truth.record.command, -half, half)
    tip = exact + np.random.default_rng(seed).normal(0, 0.01 * np.ptp(exact), len(exact))
    clipped = np.clip(tip, *np.quantile(exact, (0.15, 0.85)))
    verdict = judge(replace(truth.record, measured=clipped))
    if verdict.found.is_identified:
        assert verdict.found.width.value == pytest.approx(2 * half, rel=0.1)
    assert any("least or largest value" in str(each) for each in verdict.findings)


def test_a_tip_that_rests_in_the_gap_is_not_frozen() -> None:
    """Without noise a play repeats its value exactly, at its ends too."""
    truth = simulate("play", 0)
    record = truth.record
    half = truth.width / abs(truth.gain) / 2
    exact = play(record.command, -half, half)
    coarse = half / 2
    for tip in (exact, np.round(exact, 1), coarse * np.round(exact / coarse)):
        verdict = judge(replace(record, measured=tip))
        assert verdict.findings == ()
        assert verdict.found.width.value == pytest.approx(2 * half, rel=0.05)


def test_units_that_do_not_fit_are_named() -> None:
    record = simulate("play", 0).record
    gain = judged("play", 0).found.gain
    metres = replace(record, measured=record.measured / gain / 1000, units=("mm", "mm"))
    assert "near 1 over the number of mm in 1 m" in judge(metres).text
    millimetres = replace(record, measured=1000 * record.measured / gain, units=("m", "m"))
    assert "near the number of mm in 1 m" in judge(millimetres).text
    degrees = replace(record, measured=record.measured / gain, units=("deg", "mm"))
    assert "the command is in deg, the tip in mm" in judge(degrees).text
    numbers = replace(record, time=np.arange(len(record.rows), dtype=float))
    assert "these look like sample numbers, not seconds" in str(without_errors(numbers)[1][0])
    assert without_errors(replace(numbers, time_unit="s"))[1] == []
    slow = replace(record, time=1000 * record.clock)
    assert "a sample every 20 s is implausible" in judge(slow).text


def test_a_verdict_says_what_compensation_would_do() -> None:
    """The error without the loop is that of an independent play."""
    truth = simulate("play", 4)
    verdict = judge(truth.record)
    assert verdict.compensation is not None
    path = truth.gain * truth.record.command
    half = truth.width / 2
    before = play(path - path.mean(), -half, half, start=0.0) - (path - path.mean())
    assert verdict.compensation.before == pytest.approx(
        np.sqrt(np.mean(before[1000:] ** 2)), rel=0.15
    )
    assert verdict.compensation.after < 0.4 * verdict.compensation.before
    assert verdict.helps
    assert "With the loop the tip's RMS error would fall from" in verdict.text


def test_a_tip_that_moves_before_its_command_is_no_alignment() -> None:
    """Columns named the wrong way round; clocks that differ by 20 ms are no lead."""
    record = simulate("play", 2).record
    swapped = judge(replace(record, command=record.measured, measured=record.command))
    assert not swapped.found.is_aligned
    assert swapped.settings is None
    assert "before its command: are --command and --measured swapped" in swapped.text
    assert "Next: exchange --command and --measured" in swapped.text
    linear = simulate("linear", 2).record
    for lead, is_early in ((0.02, False), (0.4, True)):
        tip = np.interp(linear.clock + lead, linear.clock, linear.measured)
        found = judge(replace(linear, measured=tip)).found
        assert (found.is_early, found.is_aligned) == (is_early, not is_early)


def test_of_many_places_three_are_named() -> None:
    lines = tuple((line, line) for line in (8, 10, 12, 14, 16))
    for count, place in (
        (1, "(line 8)"),
        (3, "(lines 8, 10, 12)"),
        (4, "(lines 8, 10, 12 and 1 more place)"),
        (5, "(lines 8, 10, 12 and 2 more places)"),
    ):
        assert str(Finding("tip", "left out", lines[:count])) == f"tip: left out {place}"
