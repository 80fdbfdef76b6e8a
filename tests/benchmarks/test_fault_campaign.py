"""The fault campaign: evaluation of runs, and repeatability of a row."""

import json
import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from common.paths import ROOT
from faults import campaign, envelopes, evaluation, runs, scenarios, tables
from faults.operator_input import OperatorInput
from faults.recorder import RunRecorder
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.loop.safety import Reaction, Supervision
from tautscope.twin.faults import KINDS, Fault

CONFIG = load_config()
needs_fork = pytest.mark.skipif(sys.platform == "win32", reason="the campaign forks")


def outcome(excursion=(0.0, 0.0, 0.0), detected=math.nan, stopped=False, duration=1.0, tip=None):
    fault = Fault("frozen", 0.0, duration)
    rest = ("none", (), stopped, 0.0, 0.0, 0, 0, ())
    return evaluation.Outcome(
        "frozen", 0, fault, excursion, excursion if tip is None else tip, detected, *rest
    )


def traces(recorder, truth=None):
    values = np.zeros((3, 3)) if truth is None else truth
    return evaluation.Traces(values, values, recorder.summary(), values, values)


def run_campaign(folder, *arguments):
    file = folder / "rows.json"
    command = [sys.executable, "benchmarks/faults", "--workers", "1", "--json", str(file)]
    found = subprocess.run(
        [*command, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert found.returncode == 0, found.stderr
    (rows,) = json.loads(file.read_text(encoding="utf-8")).values()
    return {(row["kind"], row["seed"]): row for row in rows}


@needs_fork
@pytest.mark.parametrize("seed", [101, 107])
def test_excursion_without_images_stays_within_the_goal(seed):
    """Insertion reverses meanwhile, and rotation takes all of the friction for a moment."""
    (found,) = runs.run_seed(seed, ["camera_off"])
    assert found.fault.duration > 1.4, f"seed {seed}"
    assert (np.array(found.excursion) <= evaluation.TRANSIENT_GOAL).all(), f"seed {seed}: {found}"


@needs_fork
def test_a_row_is_the_same_when_its_run_is_repeated_alone(tmp_path):
    kinds = ["--kind", "swapped", "--kind", "ok", "--kind", "stall", "--kind", "start_negative"]
    several = run_campaign(tmp_path, *kinds, "--runs", "8", "--first-seed", "200")
    assert set(several) == {(kind, seed) for kind in kinds[1::2] for seed in (200, 201)}
    alone = run_campaign(tmp_path, "--kind", "swapped", "--seed", "201")
    assert alone["swapped", 201] == several["swapped", 201], "seed 201"
    for seed in (200, 201):
        assert several["ok", seed]["excursion"] == [0.0, 0.0, 0.0], seed
        assert several["ok", seed]["ending"] == "masked", seed
        assert several["start_negative", seed]["ending"] == "stopped", seed
        assert several["swapped", seed]["fault"]["start"] >= scenarios.ESTIMATION_TIME, seed


def test_shards_contain_every_seed_once():
    def seeds(shard):
        sys.argv = ["faults", "--runs", "1000", "--first-seed", "5", "--shard", shard]
        return campaign.select_seeds(campaign.arguments(), 1000)

    whole = seeds("1/1")
    assert len(whole) * len(KINDS) >= 1000
    assert sorted(seed for part in ("1/3", "2/3", "3/3") for seed in seeds(part)) == whole


def test_excursion_is_relative_to_the_fault_free_run():
    base = np.zeros((5, 3))
    truth = base.copy()
    truth[2, 0], truth[3, 1], truth[4, 2] = -2e-3, 0.3, -0.1
    np.testing.assert_allclose(evaluation.excursion(truth, base, None), [2e-3, 0.3, 0.1])


def test_excursion_after_a_stop_is_relative_to_the_remaining_path():
    base = np.outer(np.arange(6.0), [1.0, 0.0, 0.0])
    truth = base.copy()
    truth[3:, 0] = [3.0, 3.5, 3.5]
    assert evaluation.excursion(truth, base, 3)[0] == 0, "at rest on the path"
    assert evaluation.excursion(truth, base, None)[0] == 1.5
    truth[3:, 0] = [3.0, 2.0, 2.0]
    assert evaluation.excursion(truth, base, 3)[0] == 1, "back"
    truth[3:, 0] = [3.0, 6.0, 6.0]
    assert evaluation.excursion(truth, base, 3)[0] == 2, "beyond the path"
    truth[1, 0] = 11.0
    assert evaluation.excursion(truth, base, 3)[0] == 10, "before the stop"


@pytest.mark.parametrize(
    ("run", "ending", "beyond"),
    [
        (outcome(), "masked", False),
        (outcome((0.9e-3, 0.17, 0.1)), "masked", False),
        (outcome((1.1e-3, 0, 0)), "SILENT", True),
        (outcome((0, 0.19, 0)), "SILENT", True),
        (outcome((1.1e-3, 0, 0), duration=math.inf), "unnoticed", False),
        (outcome((10.4e-3, 0, 0), duration=math.inf), "SILENT", True),
        (outcome(tip=(1.1e-3, 0, 0)), "unnoticed", False),
        (outcome(tip=(1.1e-3, 0, 0), detected=0.1), "warned", False),
        (outcome((1.1e-3, 0, 0), detected=0.1), "warned", True),
        (outcome((1.1e-3, 0, 0), detected=0.1, stopped=True), "stopped", True),
        (outcome((10.2e-3, 0, 0), detected=0.1, duration=math.inf), "warned", False),
        (outcome((10.4e-3, 0, 0), detected=0.1, duration=math.inf), "warned", True),
    ],
)
def test_verdicts(run, ending, beyond):
    row = tables.to_row(run)
    assert (row["ending"], row["beyond"]) == (ending, beyond)


def test_kinds_within_the_goal_are_listed_below_the_table():
    rows = [tables.to_row(outcome((excursion, 0, 0), detected=0.1)) for excursion in (5e-4, 5e-3)]
    rows[0]["kind"] = "late"
    *_, row, empty, others = tables.table(rows).splitlines()
    assert row.startswith("| frozen V7 |  | 1 | 5.00 |  | 1, 0.10 |") and not empty
    assert others.endswith(": late V8 (0.50, 1).")


def test_detectors_that_are_off_with_equal_figures_share_a_row():
    def rows(name, excursion):
        run = tables.to_row(outcome((excursion, 0, 0), duration=1.0))
        return [run | {"raised": [name]}, run | {"raised": []}]

    found = {"late": rows("late", 1e-3), "clock": rows("clock", 4e-3), "lost": rows("lost", 1e-3)}
    found["merged"] = rows("other", 9e-3)
    lines = tables.off_table(found).splitlines()
    assert "No run raises `merged`." in lines[0]
    assert [line.split(" | ")[:2] for line in lines[4:]] == [
        ["| late 1, lost 1", "1.00"],
        ["| clock 1", "4.00"],
    ]


def test_goal_of_permanent_faults_is_the_compensated_slack_and_a_margin():
    np.testing.assert_allclose(evaluation.permanent_goal("paper")[0], 8.3e-3)
    np.testing.assert_allclose(evaluation.permanent_goal("best")[0], 10.3e-3)


def test_operator_input_rests_in_pauses_and_continues_from_there():
    now = 0.0
    motion = OperatorInput(CONFIG, {Dof.INSERTION: 7.5}, lambda: now, 10.0)
    speed = 2 * math.pi / 7.5 * CONFIG.experiment.insertion.amplitude
    assert speed == pytest.approx(12.6e-3, rel=0.01), "the largest speed"
    motion.pauses = [(1.0, 2.0), (3.0, 3.5)]
    free = OperatorInput(CONFIG, {Dof.INSERTION: 7.5}, lambda: now, 10.0)
    positions = {}
    for now in (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.25, 4.0):
        positions[now] = motion(0.0)[0], free(0.0)[0]
    assert positions[0.5][0] == positions[0.5][1]
    assert positions[1.0][0] == positions[1.5][0] == positions[2.0][0]
    moved = [positions[2.5][i] - positions[2.0][i] for i in (0, 1)]
    assert moved[0] == pytest.approx(moved[1])
    assert positions[3.25][0] == pytest.approx(positions[3.0][0])
    assert positions[4.0][0] != positions[3.25][0]


def test_wrong_start_values_are_configured_or_refused():
    wide = scenarios.with_start_values(CONFIG, Fault("start_wide", severity=1.5))
    assert wide.insertion.delta_plus - wide.insertion.delta_minus == pytest.approx(15e-3)
    for kind in ("start_negative", "start_nan"):
        with pytest.raises(ConfigError):
            scenarios.with_start_values(CONFIG, Fault(kind))
    (refused,) = runs.run_seed(3, ["start_negative"])
    assert (refused.stopped, refused.reaction, refused.detected) == (True, "disable", 0.0)


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_drawn_faults_are_repeatable_and_cover_durations_and_dofs(kind):
    drawn = [scenarios.draw_fault(kind, seed, 10.0) for seed in range(100)]
    assert drawn[3] == scenarios.draw_fault(kind, 3, 10.0)
    transient = sum(math.isfinite(each.duration) for each in drawn)
    assert transient == 0 if not KINDS[kind].has_duration else 50 < transient < 90, "seeds 0 to 99"
    assert {each.dof for each in drawn} == set(Dof)


def test_longer_faults_are_the_same_but_for_their_durations():
    usual = [scenarios.draw_fault("noisy", seed, 10.0) for seed in range(50)]
    longer = [scenarios.draw_fault("noisy", seed, 10.0, 6.0) for seed in range(50)]
    assert [replace(each, duration=1.0) for each in usual] == [
        replace(each, duration=1.0) for each in longer
    ]
    durations = [each.duration for each in longer if math.isfinite(each.duration)]
    assert 5 < max(durations) <= 6
    assert max(each.duration for each in usual if math.isfinite(each.duration)) <= 2


def test_recorder_keeps_the_highest_reaction_and_the_stop():
    recorder = RunRecorder(lambda: 0.0, 2.0, 0.005)
    reports = [
        (1.0, Reaction.HOLD_ESTIMATE, ("frozen",)),
        (1.5, Reaction.NONE, ()),
        (2.5, Reaction.WARN, ("frozen",)),
        (3.0, Reaction.HOLD_MOTION, ("frozen", "late_tick")),
        (3.5, Reaction.FADE, ("late_tick",)),
        (4.0, Reaction.HOLD_ESTIMATE, ("late_tick",)),
    ]
    for now, reaction, flags in reports:
        recorder.record(now, Supervision(reaction, flags, (), 1.0))
    found = recorder.summary()
    assert found["flags"] == {"frozen": [(-1.0, -0.5), (0.5, 1.5)], "late_tick": [(1.0, math.inf)]}
    assert (found["reaction"], found["stopped"], found["stop_tick"]) == ("hold_motion", True, 200)
    assert (found["holds"], found["stops"]) == (2, 1)


@pytest.mark.parametrize(
    ("raised", "usual", "first"),
    [
        ([(0.5, 1.0)], [], 0.5),
        ([(-1.0, 1.0)], [], 0.0),
        ([(-1.0, -0.5)], [], math.inf),
        ([(0.5, 1.0)], [(0.6, 0.9)], math.inf),
        ([(0.5, 2.0)], [(0.6, 0.9)], 0.9 + evaluation.FLAG_TOLERANCE),
        ([(0.5, 2.0)], [(0.6, 0.9), (1.2, math.inf)], math.inf),
        ([(0.3, 1.0)], [(0.6, 0.9)], 0.3),
        ([(0.5, 0.7), (3.0, 3.1)], [(0.5, 0.7)], 3.0),
    ],
)
def test_a_flag_of_the_fault_free_run_is_no_detection(raised, usual, first):
    assert evaluation.detection_time(raised, usual) == pytest.approx(first)


def test_flags_of_the_fault_free_run_are_not_attributed_to_the_fault():
    recorder = RunRecorder(lambda: 0.0, 0.0, 0.005)
    recorder.record_flag("merged", 1.0)
    recorder.record_flag("frozen", 2.0)
    usual = {"flags": {"merged": [(1.1, math.inf)], "late": [(0.0, 1.0)]}}
    alone = evaluation.evaluate_run(
        0, Fault("frozen"), traces(recorder), traces(recorder), {"flags": {}}
    )
    assert (alone.detected, alone.flags) == (1.0, ("merged", "frozen"))
    both = evaluation.evaluate_run(0, Fault("frozen"), traces(recorder), traces(recorder), usual)
    assert (both.detected, both.flags) == (2.0, ("frozen",))
    assert both.raised == ("frozen", "late", "merged")


def test_open_loop_motion_is_subtracted_from_the_excursion():
    base = np.zeros((6, 3))
    open_loop, found = base.copy(), base.copy()
    open_loop[1:3, 0] = 4.0
    found[:, 0] = [0.0, 3.0, 4.5, 4.0, 0.0, -1.0]
    envelope = envelopes.open_loop_envelope(open_loop, base)
    assert evaluation.excursion(found, base, None, envelope)[0] == 1.0, "on the other side"
    found[5] = 0
    assert evaluation.excursion(found, base, None, envelope)[0] == 0.5, "largest value so far"
    found[0, 0] = 1.0
    assert evaluation.excursion(found, base, None, envelope)[0] == 1.0, "before the motion"
    assert evaluation.excursion(found, base, None)[0] == 4.5


def test_input_envelope_follows_the_accepted_part_of_the_reference():
    intended = np.zeros((4, 3))
    reported = intended.copy()
    reported[1:3, 0] = 5.0
    low, high = envelopes.input_envelope("hand_step", intended, reported, np.ones(3))
    # A step of 5, of which 1 is accepted and 4 are rejected; then back.
    np.testing.assert_allclose(high[:, 0], [0, 0, 5, 5, 5])
    np.testing.assert_allclose(low[:, 0], [0, 0, 0, 0, 0])
    low, _ = envelopes.input_envelope("hand_late", intended, -reported, np.ones(3))
    np.testing.assert_allclose(low[:, 0], [0, 0, -5, -5, -5])
    ramp = np.arange(1.0, 5.0)[:, None] * [1.0, 0.0, 0.0]
    behind = np.repeat(ramp[:1], 4, axis=0)
    behind[3] = ramp[3]
    low, high = envelopes.input_envelope("hand_slow", ramp, behind, np.full(3, 0.5))
    np.testing.assert_allclose(low[:, 0], [0, 0, -1, -2, -2.5], err_msg="2.5 of 3 rejected")
    np.testing.assert_allclose(high[:, 0], 0)
    low, _ = envelopes.input_envelope("hand_noisy", ramp, behind, np.full(3, 0.5))
    np.testing.assert_allclose(low[:, 0], [0, 0, -1, -2, -2])


def test_delay_envelope_contains_the_delayed_tip():
    base = np.cumsum(np.arange(8.0))[:, None] * np.ones(3)
    fault = Fault("hand_late", duration=1.0, severity=0.2)
    late = base[np.maximum(np.arange(8) - 2, 0)]
    envelope = envelopes.delay_envelope(fault, base, 0.1)
    assert evaluation.excursion(late, base, None)[0] > 10
    np.testing.assert_array_equal(evaluation.excursion(late, base, None, envelope), 0)
    np.testing.assert_array_equal(evaluation.excursion(late - 1, base, None, envelope), 1)
    np.testing.assert_array_equal(evaluation.excursion(base + 1, base, None, envelope), 1)


def test_only_motion_beyond_the_input_error_counts_as_excursion():
    intended, commands = np.zeros((4, 3)), np.full((5, 3), 2.0)
    reported = intended.copy()
    reported[:, 0] = [1.0, -1.0, 3.0, 0.0]
    commands_with_error = envelopes.with_input_error(commands, intended, reported, None)
    np.testing.assert_allclose(commands_with_error[:, 0], [2, 3, 1, 5, 2], err_msg="with gain 1")
    np.testing.assert_allclose(commands_with_error[:, 1:], 2.0)
    stopped = envelopes.with_input_error(commands, intended, reported, 3)
    np.testing.assert_allclose(stopped[:, 0], [2, 3, 1, 1, 1], err_msg="constant after a stop")

    base = np.zeros((3, 3))
    open_loop, found = base[:2].copy(), base.copy()
    open_loop[1, 0], found[2, 0] = 2.0, 2.5
    reported_envelope = envelopes.input_envelope(
        "hand_tremor", intended[:2], reported[:2] / 4, np.ones(3)
    )
    envelope = envelopes.union(reported_envelope, envelopes.open_loop_envelope(open_loop, base))
    np.testing.assert_allclose(envelope[1][:, 0], [0, 2, 2], err_msg="the shorter one is continued")
    np.testing.assert_allclose(envelope[0][:, 0], [0, 0, -0.25])
    recorder = RunRecorder(lambda: 0.0, 0.0, 0.005)
    run, nominal = traces(recorder, found), traces(recorder, base)
    fault, usual = Fault("hand_tremor"), {"flags": {}}
    one = evaluation.evaluate_run(
        0, fault, run, nominal, usual, envelope=envelope, reported=reported_envelope
    )
    assert one.tip[0] == 2.25, "beyond the reported reference"
    assert one.excursion[0] == 0.5, "beyond the envelope"


@needs_fork
def test_a_detector_without_flags_does_not_influence_the_run(monkeypatch):
    monkeypatch.setattr(scenarios, "ESTIMATION_TIME", 5.0)
    monkeypatch.setattr(scenarios, "OBSERVED_AFTER", 1.0)
    monkeypatch.setattr(scenarios, "OBSERVED_PERMANENT", 3.0)
    kinds = ["ok", "duplicate", "band_b_lost"]
    found = runs.run_with_each_off(202, kinds)
    (repeated,) = runs.run_seed(202, ["duplicate"], off=("merged",))
    all_on = {each.kind: each for each in runs.run_seed(202, kinds)}
    assert "merged" not in all_on["duplicate"].raised, "seed 202"
    assert repeated == all_on["duplicate"] == found["merged"][1]
    assert "merged" in all_on["band_b_lost"].raised
    without = found["merged"][2]
    assert "merged" not in without.flags
    assert "merged" in without.raised, "the run was repeated"
    assert found["late"][1:] == [all_on["duplicate"], all_on["band_b_lost"]]
