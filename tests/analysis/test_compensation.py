"""What the verdict says that the loop would do, and its figure."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Annotation
from records.simulated import simulate
from tautscope.analysis.compensation import as_played, plant, run
from tautscope.analysis.compensation import simulate as simulate_loop
from tautscope.analysis.compensator import (
    MOST_DELAY,
    Parts,
    compensator,
    notes,
    scale_of,
    sensors_of,
    shared_delays,
)
from tautscope.analysis.identification import Interval
from tautscope.analysis.models.constant_play import operator
from tautscope.analysis.slide import slide
from tautscope.analysis.verdict import judge, together
from tautscope.config import from_document
from tautscope.errors import RecordError
from tautscope.loop.reduction import HysteresisReduction
from tautscope.runs.records import Cleaning, Record, read_record
from test_findings import judged


def test_the_loop_does_on_the_other_half_what_the_verdict_says(tool_folder: Path) -> None:
    """A real tool: slack of the second half, plays fitted to the first; within 10 points."""
    record = read_record(tool_folder / "tool4_L4_run23.csv", "motor_deg", "jaw_deg")
    half = len(record.rows) // 2
    first, second = (
        judge(Record(record.command[k], record.measured[k], None, record.rows[k], Cleaning()))
        for k in (slice(half), slice(half, None))
    )
    assert second.compensation is not None
    said = 1 - second.compensation.after / second.compensation.before
    motion = as_played(second.record, second.found)
    settings, scale = compensator({"tip": motion}), scale_of(*motion)
    played, _ = as_played(first.record, first.found)
    reached = run(settings, played, *plant(first.record, first.found), scale=scale)
    assert 0.5 < said < 1
    assert 1 - reached.after / reached.before == pytest.approx(said, abs=0.1)


@pytest.mark.parametrize("kind", ["play", "delay and play", "drift"])
def test_without_the_loop_the_error_is_that_of_the_play(kind: str) -> None:
    """Half the width to both sides, less while the slack is crossed: 0.35 to 0.5 widths."""
    truth, verdict = simulate(kind, 3), judged(kind, 3)
    assert verdict.compensation is not None
    assert 0.35 < verdict.compensation.before / truth.width < 0.5
    assert verdict.compensation.helps
    assert ("a tip that itself lags stays late" in verdict.text) == (kind == "delay and play")


def test_the_figure_marks_the_width_only_where_it_is_identified() -> None:
    truth, verdict = simulate("delay and play", 1), judged("delay and play", 1)
    loop, time = slide(verdict).axes
    arrow = loop.texts[0]
    assert isinstance(arrow, Annotation)
    (left, low), (right, high) = arrow.xy, arrow.xyann
    assert abs(right - left) == pytest.approx(truth.width, rel=0.1)
    assert low == high
    assert verdict.width in loop.texts[1].get_text()
    # The ends of the arrow are on the sides of the loop, of whose samples many are at rest.
    x, y = (np.asarray(each, float) for each in loop.lines[0].get_data())
    near = np.abs(y - low) < 0.05 * np.ptp(y)
    assert left - 0.1 * truth.width < np.median(x[near]) < right + 0.1 * truth.width
    assert [line.get_label() for line in time.lines] == ["measured", "predicted"]
    for kind in ("linear", "random walk"):
        assert not slide(judged(kind, 1)).axes[0].texts


def repeated(times: int, every: int = 1) -> Record:
    """A play of 4 with 20 strokes in 100 s, again and again; the tip is seen every so often."""
    samples = np.arange(times * 5_000)
    command = 10 * np.sin(2 * np.pi * samples / 500)
    measured = operator(command, 2.0, 0.0) + np.random.default_rng(0).normal(0, 0.05, len(samples))
    measured[samples % every != 0] = np.nan
    return Record(command, measured, 0.02 * samples, samples, Cleaning())


def test_what_the_loop_would_do_does_not_depend_on_the_length_of_the_record() -> None:
    """A motion that is played faster than it is would be a harder one."""
    found = [judge(repeated(times)).compensation for times in (1, 10)]
    short, long = (each.after / each.before for each in found if each is not None)
    assert long == pytest.approx(short, rel=0.2)


def test_a_record_without_a_time_is_compensated_as_one_with_it() -> None:
    with_time = simulate("play", 3).record
    for record in (with_time, replace(with_time, time=None)):
        verdict = judge(record)
        loop = verdict.compensation
        assert loop is not None and loop.after < 0.2 * loop.before
        played, found = as_played(record, verdict.found)
        assert found.stroke == pytest.approx(
            np.ptp(played.clock) / (verdict.found.strokes), rel=0.5
        )


def test_the_loop_is_simulated_on_the_fastest_strokes_of_a_long_record() -> None:
    """At their own speed, also where the record rests for an hour."""
    moving, pause = repeated(4), 3_600.0
    after = moving.clock > 100
    record = replace(moving, time=moving.clock + np.where(after, pause, 0.0))
    found = judge(record).found
    part, late = as_played(record, found)
    assert part.clock[-1] == pytest.approx(100, abs=1)
    assert np.diff(part.clock).max() == pytest.approx(0.02)
    assert late.delay == found.delay
    part, _ = as_played(replace(record, time=4 * record.clock), found)
    assert part.clock[-1] == pytest.approx(100, abs=1)
    assert len(part.command) == pytest.approx(5_000, rel=0.02)


def test_a_slow_sensor_is_not_taken_for_a_silent_one() -> None:
    """Of a tip each second the loop would lose its compensation: each is later than `frame_gap`."""
    verdict = judge(repeated(2, every=50))
    settings = compensator({"tip": (verdict.record, verdict.found)})
    assert settings["safety"]["frame_gap"] == pytest.approx(3.0)
    assert "safety" not in compensator({"tip": (repeated(1), verdict.found)})
    assert verdict.compensation is not None
    assert verdict.compensation.after < 0.3 * verdict.compensation.before


def test_a_loop_of_a_tip_that_is_very_late_can_be_loaded() -> None:
    """Its measurements may be no older than the history."""
    record, found = judged("delay and play", 1).record, judged("delay and play", 1).found
    assert record.time is not None
    slow = replace(record, time=11 * record.time)
    late = replace(found, delay=replace(found.delay, value=1.65))
    config = from_document(compensator({"tip": (slow, late)}))
    assert config.measurement.delays[0] == pytest.approx(1.65, rel=0.02)
    assert config.safety.frame_age == config.control.history


def sine(duration: float, interval: float, period: float, late: float, size: float = 10) -> Record:
    """A play with a slack of a fifth of the amplitude, whose tip is late [s]."""
    time = np.arange(0, duration, interval)
    command = size * np.sin(2 * np.pi * time / period)
    tip = np.interp(time - late, time, operator(command, 0.1 * size, 0.0))
    tip += np.random.default_rng(0).normal(0, 1e-3 * size, len(time))
    return Record(command, tip, time, np.arange(len(time)), Cleaning())


@pytest.mark.parametrize(("duration", "period"), [(90, 15), (240, 20)])
def test_a_loop_of_a_tip_that_is_later_than_the_usual_history_can_be_loaded(
    duration: float, period: float
) -> None:
    verdict = judge(sine(duration, 0.1, period, late=3.0))
    assert verdict.helps
    config = from_document(compensator({"tip": (verdict.record, verdict.found)}))
    assert config.measurement.delays[0] == pytest.approx(3.0, rel=0.01)
    assert config.measurement.delays[0] < config.safety.frame_age <= config.control.history


def test_a_tip_that_is_too_late_for_the_loop_gets_no_settings() -> None:
    """Unless the record has no time: its clock is then any."""
    late = sine(600, 2.0, 60, late=6.0)
    verdict = judge(late)
    assert verdict.found.is_identified
    assert (verdict.settings, verdict.compensation) == (None, None)
    assert f"it is 6 s late, and the loop can use {MOST_DELAY:.3g} s" in verdict.text
    assert "Next: subtract 6 s from the tip's time stamps." in verdict.text
    assert together([judged("play", 3), replace(verdict, name="late")])[1].settings is None
    untimed = judge(replace(sine(900, 0.1, 150, late=30.0), time=None))
    assert untimed.found.delay.value > MOST_DELAY / 0.02
    assert untimed.compensation is not None


def test_a_record_that_is_faster_than_a_loop_of_metres_has_a_loop() -> None:
    """As of a piezo, or with a time in s under a title in ms."""
    for unit in ("", "mm"):
        record = replace(sine(0.6, 0.25e-3, 0.01, late=0.0, size=40), units=("", unit))
        verdict = judge(record)
        assert verdict.found.is_identified
        (dof,) = from_document(compensator({"tip": (verdict.record, verdict.found)})).dof
        assert (dof.speed == 10.0) == bool(unit)
        assert ("the loop follows 10: check the units of time and tip" in verdict.text) == bool(
            unit
        )
        assert "a stroke takes 0.005 s, and the loop has a command every 0.005 s" in verdict.text


def late_parts(*delays: float) -> Parts:
    """The same play again and again, with tips that are late by these times [s]."""
    record, found = judged("play", 3).record, judged("play", 3).found
    return {
        f"tip_{k}": (record, replace(found, delay=Interval(each, each - 1e-3, each + 1e-3)))
        for k, each in enumerate(delays)
    }


def test_tips_that_are_late_by_other_times_have_sensors_of_their_own() -> None:
    parts = late_parts(0.6, 0.0, 0.605)
    settings = compensator(parts)
    assert sensors_of(parts)[0] == [0, 1, 0]
    assert settings["measurement"]["delays"] == pytest.approx([0.6025, 0.0])
    assert "Sensor of measurement.delays, from 0 on: tip_0 0, tip_1 1, tip_2 0;" in notes(parts)[-1]
    assert sensors_of(late_parts(0.0, 0.004)) == ([0, 0], [])
    alone = simulate_loop({"tip_1": parts["tip_1"]}, "tip_1")
    assert simulate_loop(parts, "tip_1").after == pytest.approx(alone.after)
    assert not shared_delays(parts)


def test_of_more_delays_than_sensors_the_verdict_says_what_they_cost() -> None:
    parts = late_parts(0.0, 0.2, 0.3, 0.6, 0.9)
    delays = compensator(parts)["measurement"]["delays"]
    assert delays == pytest.approx([0.0, 0.25, 0.6, 0.9])
    one = judged("play", 3)
    alone = [replace(one, name=name, found=found) for name, (_, found) in parts.items()]
    verdicts = together(alone)
    what = "compensator.toml has a delay of 0.25 s for it, since the loop has at most 4 sensors"
    for index, verdict in enumerate(verdicts):
        assert (what in verdict.text) == (index in {1, 2})
        assert verdict.compensation is not None
    costs = [each.compensation.after for each in verdicts if each.compensation is not None]
    assert min(costs[1:3]) > 1.3 * costs[0]


def test_a_sensor_that_is_later_than_another_is_not_missing() -> None:
    """Its degree of freedom moves by more than its slack until the measurement arrives."""
    delays = [0.0, 0.4]
    document = {
        "dof": [{"name": each, "unit": "m", "width_limit": 2e-3, "speed": 0.1} for each in "ab"],
        "measurement": {"delays": delays},
        "safety": {"frame_age": 0.6},
    }
    config = from_document(document)
    loop, tips = HysteresisReduction(config), []
    for tick in range(4000):
        time = tick * config.control.period
        loop.step(np.full(2, 10e-3 * np.sin(time)), time)
        tips.append(loop.predicted_state)
        for sensor, delay in enumerate(delays):
            back = tick - round(delay / config.control.period)
            if tick % 8 == 0 and back >= 0:
                values = np.where(np.arange(2) == sensor, tips[back], np.nan)
                loop.on_tip(values, time, sensor=sensor)
        if tick == 1000:
            loop.acknowledge()  # before the first measurement arrived it was missing
    assert loop.supervision.latched == ()


def test_a_loop_of_a_tip_whose_noise_is_larger_than_its_slack_can_be_loaded() -> None:
    record, found = judged("play", 3).record, judged("play", 3).found
    noisy = replace(found, noise=2 * found.width.value)
    config = from_document(compensator({"tip": (record, noisy)}))
    assert config.measurement.tip_deviation == 0.3


def test_a_long_record_with_few_tips_is_simulated_whole() -> None:
    record = repeated(10, every=12_000)
    found = judge(repeated(2)).found
    assert len(as_played(record, found)[0].command) == len(record.command)


@pytest.mark.parametrize(("unit", "size"), [("", 1e4), ("m", 1e3), ("rad", 1e3), ("px", 1e-4)])
def test_the_size_of_the_numbers_does_not_matter(unit: str, size: float) -> None:
    """As of a tip in counts of an encoder, or in mm under a title with m."""
    record = simulate("play", 3).record
    units = ("", unit)
    plain = judged("play", 3).compensation
    scaled = judge(replace(record, measured=size * record.measured, units=units)).compensation
    assert plain is not None
    assert scaled is not None
    assert scaled.before == pytest.approx(size * plain.before, rel=1e-3)
    assert scaled.after == pytest.approx(size * plain.after, rel=0.05)


def test_a_tip_that_is_the_command_is_explained_by_a_gain() -> None:
    """Without noise the errors are rounding, of either sign."""
    for count in range(100, 110):
        command = np.round(6 + 6 * np.sin(np.arange(count) / 5), 2)
        record = Record(command, command / 2, None, np.arange(count), Cleaning())
        assert "What explains the record best is a gain alone" in judge(record).text


@pytest.mark.parametrize("tips", [0, 1])
def test_a_record_without_tips_is_refused(tips: int) -> None:
    command = np.sin(np.arange(200.0))
    measured = np.where(np.arange(200) < tips, command, np.nan)
    with pytest.raises(RecordError, match=f"measured: got '{tips} tips"):
        judge(Record(command, measured, None, np.arange(200), Cleaning()))
