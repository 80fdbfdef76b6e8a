"""The soak: its references, its tenths, and the goals of its rows."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from common.paths import ROOT
from numpy.typing import NDArray
from plants.simulated import HALF
from soak.cases import (
    FAULT_EVERY,
    IMAGE_FAULTS,
    PLANTS,
    REPEATED,
    Case,
    Outcome,
    PlantName,
    _Coverage,
    _Look,
    draw_faults,
    simulate,
)
from soak.endurance import Session, run_session
from soak.endurance import table as endurance_table
from soak.references import (
    EASING,
    MOVING,
    PARTS,
    RESTING,
    RETURN,
    Motion,
    RestingMotion,
    SteadySines,
    make_reference,
)
from soak.rows import table, to_rows
from tautscope.config import load_config
from tautscope.dof import Dof

CONFIG = load_config()
CENTRE = np.array([CONFIG.experiment[dof].centre for dof in Dof])
SECONDS, INTERVAL = 2000.0, 0.02


def positions(motion: Motion, stroke: float) -> NDArray[np.float64]:
    reference = make_reference(CONFIG, motion, stroke, 3, SECONDS)
    return np.array([reference(time) for time in np.arange(0, SECONDS, INTERVAL)])


@pytest.mark.parametrize("motion", ["sines", "hand"])
def test_the_longest_stroke_is_a_multiple_of_the_slack(motion: Motion) -> None:
    found = positions(motion, 0.6)
    np.testing.assert_allclose(found[0], CENTRE, atol=1e-12)
    longest = np.ptp(found, axis=0) / (2 * HALF)
    assert np.all(longest <= 0.6 + 1e-9) and np.all(longest > 0.48), longest
    assert np.abs(np.diff(found, axis=0) / HALF).max() < 0.04


def test_an_operators_motion_is_the_same_in_every_part() -> None:
    found = positions("hand", 1.0)
    parts = (found - CENTRE).reshape(PARTS, -1, 3)
    np.testing.assert_allclose(parts, np.broadcast_to(parts[0], parts.shape), atol=1e-9)
    last = round(RETURN / INTERVAL)
    assert np.ptp(parts[0][-last:], axis=0).max() > 0


def test_a_motion_with_rests_is_the_motion_with_a_clock_that_stands() -> None:
    moving = SteadySines(CENTRE, HALF, SECONDS)
    resting = RestingMotion(moving, SECONDS)
    cycle = MOVING + RESTING + EASING
    times = np.arange(0, 2 * cycle, INTERVAL)
    found = np.array([resting(time) for time in times])
    speed = np.abs(np.diff(found, axis=0)).max(axis=1) / INTERVAL
    rests = times[1:] % cycle >= MOVING + EASING + INTERVAL
    assert np.all(speed[rests] == 0)
    rates = np.array([0.8, 0.63, 0.5])
    assert np.all(np.abs(np.diff(found, axis=0)) <= HALF * rates * INTERVAL)
    np.testing.assert_allclose(resting(cycle), moving(MOVING), atol=1e-12)
    own_clock = np.interp(times % cycle, [EASING, MOVING], [EASING / 2, MOVING - EASING / 2])
    at_full_speed = (times % cycle >= EASING) & (times % cycle <= MOVING)
    expected = [
        moving(own + MOVING * (time // cycle)) for time, own in zip(times, own_clock, strict=True)
    ]
    np.testing.assert_allclose(found[at_full_speed], np.array(expected)[at_full_speed], atol=1e-12)


def test_in_all_images_of_a_rest_the_error_repeats() -> None:
    look = _Look(Case("plays", "rests", 1.0, 0, 60.0))
    features = np.array([100.0, 200.0, 300.0, 150.0])
    error = look._repeated(features)
    np.testing.assert_array_equal(error, look._repeated(features))
    assert 0 < np.abs(error).max() <= REPEATED
    assert not _Look(Case("plays", "hand", 1.0, 0, 60.0))._repeated(features).any()


def test_sessions_of_the_whole_loop_are_alike_and_lose_nothing(tmp_path: Path) -> None:
    first, second = (run_session(CONFIG, 4.0, tmp_path) for _ in range(2))
    assert first.ticks == first.in_log == 4.0 / CONFIG.control.period
    assert first.error == second.error
    assert (first.descriptors, first.threads) == (second.descriptors, second.threads)
    assert not list(tmp_path.iterdir())
    assert "| 2 |" in endurance_table([first, second])


def test_the_table_of_sessions_has_the_worst_value_of_all() -> None:
    usual = Session([1e-3, 0.2, 0.3], 9e-6, 100_000_000, 6, 1, 1000, 1000, 10**9)
    odd = replace(usual, error=[2e-3, 0.1, 0.3], memory=200_000_000, in_log=998, threads=4)
    lines = endurance_table([usual, usual, odd, usual]).splitlines()[2:-2]
    assert [line.split(" | ")[0] for line in lines] == ["| 1", "| 2", "| 4", "| worst of all"]
    assert lines[-1] == "| worst of all | 2.000 | 0.200 | 0.300 | 9 | 200.0 | 6 | 4 | 2 |"


@pytest.mark.parametrize("plant", PLANTS)
def test_every_tenth_is_judged_by_itself(plant: PlantName) -> None:
    outcome = simulate(Case(plant, "sines", 1.6, 1, 20.0))
    errors = np.array(outcome.errors)
    assert errors.shape == (PARTS, 3)
    # The sine of insertion without compensation has an error of about half a half width.
    assert np.all(errors > 0) and np.all(errors < 1.2 * HALF), errors
    assert outcome.held == 0
    assert not outcome.coverage or plant == "plays"


def test_each_minute_has_one_fault_of_the_images_and_time_without_it() -> None:
    case = Case("faults", "hand", 1.0, 700, 7200.0)
    faults = draw_faults(case)
    assert faults == draw_faults(case)
    assert [int(fault.start // FAULT_EVERY) for fault in faults] == list(range(120))
    assert all(fault.start % FAULT_EVERY + fault.duration <= FAULT_EVERY for fault in faults)
    assert len({fault.kind for fault in faults}) > 0.9 * len(IMAGE_FAULTS)


def outcome(*insertion: float, coverage: dict[str, list[float]] | None = None) -> Outcome:
    errors = [[value, 1.0, 1.0] for value in insertion]
    return Outcome(errors, 0.0, coverage or {})


def test_a_row_compares_the_later_tenths_with_the_second() -> None:
    growing = outcome(9.0, 1.0, 1.1, 1.3, *[1.0] * 6, coverage={"width": [0.99, 0.94, 1.0]})
    case = Case("plays", "sines", 0.6, 0, 7200.0)
    rows = {(row["quantity"], row["dof"]): row for row in to_rows({case: growing})}
    row = rows["error over the second tenth's", "insertion"]
    assert row["median"] == pytest.approx(1.3) and row["goal"] == 1.15 and not row["holds"]
    assert rows["error over the second tenth's", "bending"]["holds"]
    assert rows["width within 3 sigma", "insertion"]["holds"]
    assert not rows["width within 3 sigma", "rotation"]["holds"]
    assert ("gain within 3 sigma", "insertion") not in rows
    shown = table({case: growing})
    assert "| 1e+03, 1.3e+03 | 1, 1 | 1, 1 | 1.30 (missed) |" in shown
    assert "Within 3 sigma: at least 94 % of the time." in shown


def test_intervals_are_compared_with_the_truth_of_the_plays() -> None:
    coverage = _Coverage()
    assert coverage.shares() == {}
    for off in (0.0, 0.2, 0.4, 0.6):
        coverage.add(
            SimpleNamespace(
                half_width=HALF * (1 + off),
                width_std=0.1 * HALF,
                gain=np.array([1.0, 1 - off, 1.0]),
                gain_std=np.full(3, 0.15),
            )
        )
    assert coverage.shares() == {"width": [0.5] * 3, "gain": [1.0, 0.75, 1.0]}


@pytest.mark.parametrize("plant", PLANTS)
def test_the_page_has_a_section_for_the_table_of(plant: str) -> None:
    page = (ROOT / "docs" / "soak.md").read_text(encoding="utf-8")
    assert page.index(f"<!-- soak {plant}: begin -->") < page.index(f"<!-- soak {plant}: end -->")
