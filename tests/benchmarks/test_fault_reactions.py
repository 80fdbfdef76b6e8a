"""Faults are detected by the whole loop with its monitors, row by row of the hazard table."""

import sys

import pytest
from faults import runs, scenarios, tables

SEEDS = (200, 201)

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the campaign forks")

EXPECTED_FLAGS = {
    "V1": (("band_a_lost", "band_b_lost"), {"merged"}),
    "V2": (("swapped",), {"swapped"}),
    "V3": (("merged",), {"innovation", "merged"}),
    "V4": (("outlier", "random"), {"innovation", "merged", "lost"}),
    "V5": (("bands_lost",), {"lost"}),
    "V7": (("frozen",), {"frozen"}),
    "V8": (("late",), {"late", "dropped"}),
    "V9": (("duplicate", "reordered"), {"duplicate"}),
    "V10": (("slow_camera",), {"dropped"}),
    "V11": (
        ("stamp_hour", "stamp_nan", "stamp_stuck"),
        {"clock", "late", "duplicate", "captured_at"},
    ),
    "V12": (("camera_off",), {"dropped"}),
    "V14": (("mirrored", "turned"), {"innovation", "swapped", "merged"}),
    "C3": (("not_finite", "hand_nan"), {"features", "reference", "reference_invalid"}),
    "C5": (("hand_displaced",), {"reference_jump"}),
    "C7": (("stall",), {"late_tick"}),
    "C8": (("hand_slow",), {"reference_late"}),
    "C9": (("hand_step", "hand_fast"), {"reference_jump", "reference_fast"}),
    "D1": (("axis_off",), {"drive_fault"}),
    "D5": (("axis_reversed",), {"following_error", "innovation"}),
    "P5": (
        ("clock_ahead", "clock_back", "clock_slow"),
        {"late_tick", "clock", "sample.time", "late", "frame_rate"},
    ),
}


@pytest.fixture(scope="module")
def rows():
    kinds = [name for names, _ in EXPECTED_FLAGS.values() for name in names]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scenarios, "OBSERVED_AFTER", 0.5)
        patch.setattr(scenarios, "OBSERVED_PERMANENT", 3.0)
        return {
            (found.kind, seed): tables.to_row(found)
            for seed in SEEDS
            for found in runs.run_seed(seed, kinds)
        }


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("hazard", EXPECTED_FLAGS)
def test_faults_are_detected(rows, hazard, seed):
    kinds, flags = EXPECTED_FLAGS[hazard]
    for kind in kinds:
        row = rows[kind, seed]
        assert row["ending"] in {"warned", "stopped"}, (kind, seed, row["excursion"])
        assert flags & set(row["flags"]), (kind, seed, row["flags"])
