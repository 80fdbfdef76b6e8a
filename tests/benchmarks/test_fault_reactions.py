"""Faults are detected by the whole loop with its monitors, row by row of the hazard table."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from common.paths import ROOT

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
def rows(tmp_path_factory):
    file = tmp_path_factory.mktemp("campaign") / "rows.json"
    kinds = [
        word for names, _ in EXPECTED_FLAGS.values() for name in names for word in ("--kind", name)
    ]
    runs = str(len(SEEDS) * len(kinds) // 2)
    command = [sys.executable, "benchmarks/faults", *kinds, "--runs", runs, "--workers", "1"]
    subprocess.run(
        [*command, "--first-seed", str(SEEDS[0]), "--json", str(file)], cwd=ROOT, check=True
    )
    (found,) = json.loads(file.read_text(encoding="utf-8")).values()
    return {(row["kind"], row["seed"]): row for row in found}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("hazard", EXPECTED_FLAGS)
def test_faults_are_detected(rows, hazard, seed):
    kinds, flags = EXPECTED_FLAGS[hazard]
    for kind in kinds:
        row = rows[kind, seed]
        assert row["ending"] in {"warned", "stopped"}, (kind, seed, row["excursion"])
        assert flags & set(row["flags"]), (kind, seed, row["flags"])
