"""The fault campaign: how it counts, and that a row comes out again."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.loop.safety import Reaction, Supervision
from tautscope.twin.faults import KINDS, Fault

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import fault_bands as bands
import fault_draws as draws
import fault_judgement as judgement
import fault_runs as runs
import fault_tables as tables
from fault_hand import Hand
from fault_watch import Watch

ROOT = Path(__file__).resolve().parents[1]
CONFIG = load_config()
needs_fork = pytest.mark.skipif(sys.platform == "win32", reason="the campaign forks")


def outcome(excursion=(0.0, 0.0, 0.0), detected=math.nan, stopped=False, duration=1.0, tip=None):
    fault = Fault("frozen", 0.0, duration)
    rest = ("none", (), stopped, 0.0, 0.0, 0, 0, ())
    return judgement.Outcome(
        "frozen", 0, fault, excursion, excursion if tip is None else tip, detected, *rest
    )


def traces(watch, truth=None):
    still = np.zeros((3, 3)) if truth is None else truth
    return judgement.Traces(still, still, watch.said(), still, still)


def campaign(folder, *arguments):
    file = folder / "rows.json"
    command = [sys.executable, "benchmarks/faults.py", "--workers", "1", "--json", str(file)]
    found = subprocess.run(
        [*command, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert found.returncode == 0, found.stderr
    (rows,) = json.loads(file.read_text(encoding="utf-8")).values()
    return {(row["kind"], row["seed"]): row for row in rows}


@needs_fork
@pytest.mark.parametrize("seed", [101, 107])
def test_without_images_both_motions_of_the_shaft_go_on(seed):
    """Insertion reverses meanwhile, and rotation has all of the friction for a moment."""
    (found,) = runs.study(seed, ["camera_off"])
    assert found.fault.duration > 1.4, f"seed {seed}"
    assert (np.array(found.excursion) <= judgement.PASSING).all(), f"seed {seed}: {found}"


@needs_fork
def test_a_row_comes_out_again_alone(tmp_path):
    kinds = ["--kind", "swapped", "--kind", "ok", "--kind", "stall", "--kind", "start_negative"]
    several = campaign(tmp_path, *kinds, "--runs", "8", "--first-seed", "200")
    assert set(several) == {(kind, seed) for kind in kinds[1::2] for seed in (200, 201)}
    alone = campaign(tmp_path, "--kind", "swapped", "--seed", "201")
    assert alone["swapped", 201] == several["swapped", 201], "seed 201"
    for seed in (200, 201):
        assert several["ok", seed]["excursion"] == [0.0, 0.0, 0.0], seed
        assert several["ok", seed]["ending"] == "masked", seed
        assert several["start_negative", seed]["ending"] == "stopped", seed
        assert several["swapped", seed]["fault"]["start"] >= draws.LEARNING, seed


def test_shards_are_all_seeds_once():
    import faults

    def seeds(shard):
        sys.argv = ["faults.py", "--runs", "1000", "--first-seed", "5", "--shard", shard]
        return faults.chosen(faults.arguments(), 1000)

    whole = seeds("1/1")
    assert len(whole) * len(KINDS) >= 1000
    assert sorted(seed for part in ("1/3", "2/3", "3/3") for seed in seeds(part)) == whole


def test_the_excursion_is_against_the_run_without_the_fault():
    base = np.zeros((5, 3))
    truth = base.copy()
    truth[2, 0], truth[3, 1], truth[4, 2] = -2e-3, 0.3, -0.1
    np.testing.assert_allclose(judgement.excursion(truth, base, None), [2e-3, 0.3, 0.1])


def test_after_a_stop_it_is_against_the_way_that_was_to_come():
    base = np.outer(np.arange(6.0), [1.0, 0.0, 0.0])
    truth = base.copy()
    truth[3:, 0] = [3.0, 3.5, 3.5]
    assert judgement.excursion(truth, base, 3)[0] == 0, "coming to rest on the way"
    assert judgement.excursion(truth, base, None)[0] == 1.5
    truth[3:, 0] = [3.0, 2.0, 2.0]
    assert judgement.excursion(truth, base, 3)[0] == 1, "back"
    truth[3:, 0] = [3.0, 6.0, 6.0]
    assert judgement.excursion(truth, base, 3)[0] == 2, "ahead of it"
    truth[1, 0] = 11.0
    assert judgement.excursion(truth, base, 3)[0] == 10, "before the stop too"


@pytest.mark.parametrize(
    ("made", "ending", "beyond"),
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
def test_endings(made, ending, beyond):
    row = tables.to_row(made)
    assert (row["ending"], row["beyond"]) == (ending, beyond)


def test_what_a_profile_makes_up_for_may_be_given_back():
    np.testing.assert_allclose(judgement.lasting("paper")[0], 8.3e-3)
    np.testing.assert_allclose(judgement.lasting("best")[0], 10.3e-3)


def test_the_hand_rests_in_pauses_and_goes_on_from_there():
    now = 0.0
    hand = Hand(CONFIG, {Dof.INSERTION: 7.5}, lambda: now, 10.0)
    speed = 2 * math.pi / 7.5 * CONFIG.experiment.insertion.amplitude
    assert speed == pytest.approx(12.6e-3, rel=0.01), "the hand's largest"
    hand.pauses = [(1.0, 2.0), (3.0, 3.5)]
    free = Hand(CONFIG, {Dof.INSERTION: 7.5}, lambda: now, 10.0)
    positions = {}
    for now in (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.25, 4.0):
        positions[now] = hand(0.0)[0], free(0.0)[0]
    assert positions[0.5][0] == positions[0.5][1]
    assert positions[1.0][0] == positions[1.5][0] == positions[2.0][0]
    moved = [positions[2.5][i] - positions[2.0][i] for i in (0, 1)]
    assert moved[0] == pytest.approx(moved[1])
    assert positions[3.25][0] == pytest.approx(positions[3.0][0])
    assert positions[4.0][0] != positions[3.25][0]


def test_a_wrong_start_is_told_or_refused():
    wide = draws.told(CONFIG, Fault("start_wide", severity=1.5))
    assert wide.insertion.delta_plus - wide.insertion.delta_minus == pytest.approx(15e-3)
    for kind in ("start_negative", "start_nan"):
        with pytest.raises(ConfigError):
            draws.told(CONFIG, Fault(kind))
    (refused,) = runs.study(3, ["start_negative"])
    assert (refused.stopped, refused.reaction, refused.detected) == (True, "disable", 0.0)


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_drawn_faults_are_faults(kind):
    drawn = [draws.drawn(kind, seed, 10.0) for seed in range(100)]
    assert drawn[3] == draws.drawn(kind, 3, 10.0)
    passing = sum(math.isfinite(each.duration) for each in drawn)
    assert passing == 0 if not KINDS[kind].has_duration else 50 < passing < 90, "seeds 0 to 99"
    assert {each.dof for each in drawn} == set(Dof)


def test_the_watch_notes_the_highest_and_when_motion_stopped():
    watch = Watch(lambda: 0.0, 2.0, 0.005)
    said = [
        (1.0, Reaction.HOLD_ESTIMATE, ("frozen",)),
        (1.5, Reaction.NONE, ()),
        (2.5, Reaction.WARN, ("frozen",)),
        (3.0, Reaction.HOLD_MOTION, ("frozen", "late_tick")),
        (3.5, Reaction.FADE, ("late_tick",)),
        (4.0, Reaction.HOLD_ESTIMATE, ("late_tick",)),
    ]
    for now, reaction, flags in said:
        watch.read(now, Supervision(reaction, flags, (), 1.0))
    found = watch.said()
    assert found["flags"] == {"frozen": [(-1.0, -0.5), (0.5, 1.5)], "late_tick": [(1.0, math.inf)]}
    assert (found["reaction"], found["stopped"], found["stop_tick"]) == ("hold_motion", True, 200)
    assert (found["holds"], found["stops"]) == (2, 1)


@pytest.mark.parametrize(
    ("found", "usual", "first"),
    [
        ([(0.5, 1.0)], [], 0.5),
        ([(-1.0, 1.0)], [], 0.0),
        ([(-1.0, -0.5)], [], math.inf),
        ([(0.5, 1.0)], [(0.6, 0.9)], math.inf),
        ([(0.5, 2.0)], [(0.6, 0.9)], 0.9 + judgement.NEAR),
        ([(0.5, 2.0)], [(0.6, 0.9), (1.2, math.inf)], math.inf),
        ([(0.3, 1.0)], [(0.6, 0.9)], 0.3),
        ([(0.5, 0.7), (3.0, 3.1)], [(0.5, 0.7)], 3.0),
    ],
)
def test_a_flag_counts_where_it_is_not_raised_without_the_fault(found, usual, first):
    assert judgement.own_from(found, usual) == pytest.approx(first)


def test_what_is_said_without_the_fault_too_is_no_notice():
    watch = Watch(lambda: 0.0, 0.0, 0.005)
    watch.raised("merged", 1.0)
    watch.raised("frozen", 2.0)
    usual = {"flags": {"merged": [(1.1, math.inf)], "late": [(0.0, 1.0)]}}
    alone = judgement.outcome(0, Fault("frozen"), traces(watch), traces(watch), {"flags": {}})
    assert (alone.detected, alone.flags) == (1.0, ("merged", "frozen"))
    both = judgement.outcome(0, Fault("frozen"), traces(watch), traces(watch), usual)
    assert (both.detected, both.flags) == (2.0, ("frozen",))
    assert both.raised == ("frozen", "late", "merged")


def test_what_motors_or_tissue_do_by_themselves_is_taken_off():
    base = np.zeros((6, 3))
    alone, found = base.copy(), base.copy()
    alone[1:3, 0] = 4.0
    found[:, 0] = [0.0, 3.0, 4.5, 4.0, 0.0, -1.0]
    band = bands.by_itself(alone, base)
    assert judgement.excursion(found, base, None, band)[0] == 1.0, "to the other side"
    found[5] = 0
    assert judgement.excursion(found, base, None, band)[0] == 0.5, "so far, and not only now"
    found[0, 0] = 1.0
    assert judgement.excursion(found, base, None, band)[0] == 1.0, "before it did"
    assert judgement.excursion(found, base, None)[0] == 4.5


def test_where_the_hands_device_says_the_tip_is_to_go_at_the_speed_that_is_taken():
    meant = np.zeros((4, 3))
    told = meant.copy()
    told[1:3, 0] = 5.0
    low, high = bands.by_the_hand("hand_step", meant, told, np.ones(3))
    # 5 at once, of which 1 is taken and 4 are thrown away; then back.
    np.testing.assert_allclose(high[:, 0], [0, 0, 5, 5, 5])
    np.testing.assert_allclose(low[:, 0], [0, 0, 0, 0, 0])
    low, _ = bands.by_the_hand("hand_late", meant, -told, np.ones(3))
    np.testing.assert_allclose(low[:, 0], [0, 0, -5, -5, -5])
    ramp = np.arange(1.0, 5.0)[:, None] * [1.0, 0.0, 0.0]
    behind = np.repeat(ramp[:1], 4, axis=0)
    behind[3] = ramp[3]
    low, high = bands.by_the_hand("hand_slow", ramp, behind, np.full(3, 0.5))
    np.testing.assert_allclose(low[:, 0], [0, 0, -1, -2, -2.5], err_msg="2.5 of 3 thrown away")
    np.testing.assert_allclose(high[:, 0], 0)
    low, _ = bands.by_the_hand("hand_noisy", ramp, behind, np.full(3, 0.5))
    np.testing.assert_allclose(low[:, 0], [0, 0, -1, -2, -2])


def test_a_tip_whose_hand_is_late_belongs_where_it_was_then():
    base = np.cumsum(np.arange(8.0))[:, None] * np.ones(3)
    fault = Fault("hand_late", duration=1.0, severity=0.2)
    late = base[np.maximum(np.arange(8) - 2, 0)]
    band = bands.as_late(fault, base, 0.1)
    assert judgement.excursion(late, base, None)[0] > 10
    np.testing.assert_array_equal(judgement.excursion(late, base, None, band), 0)
    np.testing.assert_array_equal(judgement.excursion(late - 1, base, None, band), 1)
    np.testing.assert_array_equal(judgement.excursion(base + 1, base, None, band), 1)


def test_a_tip_that_swings_by_what_the_hand_told_it_is_not_taken_back_but_what_is_added_counts():
    meant, commands = np.zeros((4, 3)), np.full((5, 3), 2.0)
    told = meant.copy()
    told[:, 0] = [1.0, -1.0, 3.0, 0.0]
    bare = bands.as_told(commands, meant, told, None)
    np.testing.assert_allclose(bare[:, 0], [2, 3, 1, 5, 2], err_msg="with gain 1, and no more")
    np.testing.assert_allclose(bare[:, 1:], 2.0)
    stopped = bands.as_told(commands, meant, told, 3)
    np.testing.assert_allclose(stopped[:, 0], [2, 3, 1, 1, 1], err_msg="nothing after a stop")

    base = np.zeros((3, 3))
    swung, found = base[:2].copy(), base.copy()
    swung[1, 0], found[2, 0] = 2.0, 2.5
    asked = bands.by_the_hand("hand_tremor", meant[:2], told[:2] / 4, np.ones(3))
    band = bands.wider(asked, bands.by_itself(swung, base))
    np.testing.assert_allclose(band[1][:, 0], [0, 2, 2], err_msg="the shorter goes on")
    np.testing.assert_allclose(band[0][:, 0], [0, 0, -0.25])
    watch = Watch(lambda: 0.0, 0.0, 0.005)
    ran, still = traces(watch, found), traces(watch, base)
    fault, usual = Fault("hand_tremor"), {"flags": {}}
    one = judgement.outcome(0, fault, ran, still, usual, band=band, asked=asked)
    assert one.tip[0] == 2.25, "beyond where the device says"
    assert one.excursion[0] == 0.5, "of which the loop did so much"


@needs_fork
def test_a_detector_that_is_silent_changes_nothing():
    kinds = ["ok", "duplicate", "band_b_lost"]
    found = runs.each_off(202, kinds)
    (again,) = runs.study(202, ["duplicate"], off=("merged",))
    guarded = {each.kind: each for each in runs.study(202, kinds)}
    assert "merged" not in guarded["duplicate"].raised, "seed 202"
    assert again == guarded["duplicate"] == found["merged"][1]
    assert "merged" in guarded["band_b_lost"].raised
    without = found["merged"][2]
    assert "merged" not in without.flags
    assert "merged" in without.raised, "it was run again"
    assert found["late"][1:] == [guarded["duplicate"], guarded["band_b_lost"]]
