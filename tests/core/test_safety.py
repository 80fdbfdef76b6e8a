"""Guards of the loop: what a fault does to the tip, how soon it is noticed, and what is done.

The instrument is three true plays seen by an ideal camera with noise, as in
tests/core/test_loop.py; the measure is the largest distance of the tip from where it is in the
same run without the fault.
"""

from __future__ import annotations

import numpy as np
import pytest
from tautscope.errors import ConfigError
from tautscope.loop.reduction import HysteresisReduction, Report, Status
from tautscope.loop.safety import DETECTORS, Reaction, checksum
from true_plays import (
    BEGIN,
    END,
    PERIOD,
    REST,
    Fault,
    Floats,
    Run,
    config,
    excursion,
    reference,
    run,
)


def frozen(now: Floats, then: Floats, chance: np.random.Generator) -> Floats | None:
    return then


def swapped(now: Floats, then: Floats, chance: np.random.Generator) -> Floats | None:
    return now[[2, 3, 0, 1]]


def wild(now: Floats, then: Floats, chance: np.random.Generator) -> Floats | None:
    return now + chance.normal(0.0, 100.0, 4)


def shifted(now: Floats, then: Floats, chance: np.random.Generator) -> Floats | None:
    return now + 60.0


def lost(now: Floats, then: Floats, chance: np.random.Generator) -> Floats | None:
    return None


def one_band(now: Floats, then: Floats, chance: np.random.Generator) -> Floats | None:
    return np.array([np.nan, np.nan, *now[2:]])


FAULTS: dict[str, tuple[Fault, set[str]]] = {
    "frozen": (frozen, {"frozen"}),
    "swapped": (swapped, {"swapped"}),
    "wild": (wild, {"innovation", "lost", "merged", "swapped"}),
    "shifted": (shifted, {"innovation", "lost", "merged"}),
    "lost": (lost, {"lost"}),
    "one band": (one_band, {"merged"}),
}


@pytest.fixture(scope="module", params=["paper", "best"])
def nominal(request: pytest.FixtureRequest) -> tuple[str, Run]:
    return request.param, run(config(request.param))


def during(found: Run) -> list[Report]:
    return [report for report in found.reports if BEGIN <= report.captured_at < END]


def test_nothing_is_raised_and_no_bit_changed_when_nothing_is_wrong(
    nominal: tuple[str, Run],
) -> None:
    profile, guarded = nominal
    bare = run(config(profile, off=list(DETECTORS)))
    np.testing.assert_array_equal(guarded.command, bare.command)
    assert {report.reaction for report in guarded.reports} == {Reaction.NONE}
    assert guarded.loop.supervision.latched == ()
    assert len(bare.reports[-1].warnings) == len(DETECTORS)
    assert all(line.startswith("safety.off = ") for line in bare.reports[-1].warnings)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_of_two_seconds_moves_the_tip_by_less_than_a_millimetre(
    name: str, nominal: tuple[str, Run]
) -> None:
    profile, good = nominal
    fault, flags = FAULTS[name]
    bad = run(config(profile), fault)
    assert excursion(good, bad) <= 1e-3, f"{profile}, {name}: {excursion(good, bad) * 1e3:.2f} mm"
    first = next(at for at, report in enumerate(during(bad)) if flags & set(report.warnings))
    assert first <= 3, "frames until it was noticed"
    assert bad.loop.supervision.reaction is Reaction.NONE
    assert flags & set(bad.loop.supervision.latched), "a warning stays until it is seen"
    bad.loop.acknowledge()
    assert bad.loop.supervision.latched == ()


@pytest.mark.parametrize("profile", ["paper", "best"])
@pytest.mark.parametrize("late", [-0.08, -0.04, -0.02, 0.0, 0.02])
def test_a_frozen_picture_is_noticed_in_three_frames_where_the_hand_turns(
    profile: str, late: float
) -> None:
    begin = 0.5 * np.pi / (12.6 / 15) + late
    found = run(config(profile), frozen, until=begin + 0.25, begin=begin)
    reports = [report for report in found.reports if report.captured_at >= begin]
    assert any("frozen" in report.warnings for report in reports[:3])
    assert reports[0].warnings == (), "the first is well"


# Of the goal of 3 mm [m]. The width that wild markers teach has one bound.
SECOND_BARRIER_MISSES = {("paper", "wild", "width_limit"): 8.5e-3}


@pytest.mark.parametrize(
    "off", ["frozen", "innovation", "jump", "slip", "swapped", "width_limit", "monitor"]
)
@pytest.mark.parametrize("name", FAULTS)
def test_with_any_detector_off_the_next_barrier_holds(
    name: str, off: str, nominal: tuple[str, Run]
) -> None:
    profile, good = nominal
    bad = run(config(profile, off=[off]), FAULTS[name][0])
    far = excursion(good, bad)
    goal = SECOND_BARRIER_MISSES.get((profile, name, off), 3e-3)
    assert far <= goal, f"{profile}, {name} without {off}: {far * 1e3:.2f} mm"


def test_the_camera_stays_away_and_comes_back(nominal: tuple[str, Run]) -> None:
    profile, good = nominal
    gone = run(config(profile), delay=lambda time: None)
    assert excursion(good, gone) <= 1e-3
    assert "dropped" in gone.loop.supervision.latched
    assert gone.loop.supervision.reaction is Reaction.NONE


def test_a_camera_that_is_gone_for_good_fades_the_compensation_with_motion() -> None:
    loop = HysteresisReduction(config())
    seen = loop.predicted_features
    for tick in range(400):
        loop.step(REST)
        if tick % 8 == 0:
            loop.on_features(seen(tick * PERIOD), tick * PERIOD)
    leads = []
    for tick in range(400, 6000):
        loop.step(reference((tick - 400) * PERIOD))
        leads.append(loop.supervision.lead)
    quiet = round((loop._config.safety.hold_time + 0.2) / PERIOD)
    assert set(leads[: quiet - 60]) == {1.0}, "it holds first"
    assert loop.supervision.reaction is Reaction.FADE and loop.supervision.lead == 0.0
    for _ in range(400):
        loop.step(reference(5600 * PERIOD))
    assert loop.supervision.lead == 0.0


def test_late_future_and_old_frames_are_refused() -> None:
    loop = HysteresisReduction(config())
    for _ in range(300):
        loop.step(REST)
    seen = loop.predicted_features(1.4)
    assert loop.on_features(seen, 1.4).reaction is Reaction.NONE
    late = loop.on_features(seen, 1.495 - 0.31)
    assert late.status is Status.DUPLICATE and "late" in late.warnings
    ahead = loop.on_features(seen, 9.0)
    assert ahead.status is Status.STALE and "clock" in ahead.warnings
    assert ahead.reaction is Reaction.HOLD_ESTIMATE
    fresh = HysteresisReduction(config())
    for _ in range(300):
        fresh.step(REST)
    assert fresh.on_features(fresh.predicted_features(1.1), 1.1).status is Status.REFUSED


def test_a_stall_stops_motion_until_the_operator_re_engages() -> None:
    loop = HysteresisReduction(config())
    before = loop.step(REST, time=0.0)
    np.testing.assert_array_equal(loop.step(REST + 7e-3, time=0.2), before)
    assert loop.supervision.reaction is Reaction.HOLD_MOTION
    np.testing.assert_array_equal(loop.step(REST + 8e-3, time=0.205), before)
    loop.engage()
    np.testing.assert_array_equal(loop.step(REST + 9e-3, time=0.21), before)
    moved = loop.step(REST + 9.1e-3, time=0.215) - before
    assert (moved > 0).all() and (moved <= 5 * 0.1e-3 * (1 + 1e-9)).all(), "nothing catches up"


def test_an_old_reference_moves_nothing() -> None:
    loop = HysteresisReduction(config())
    before = loop.step(REST, time=0.0, made_at=0.0)
    np.testing.assert_array_equal(loop.step(REST + 1e-4, time=0.06, made_at=0.0), before)
    assert loop.supervision.flags == ("reference_late", "late_tick") or (
        "reference_late" in loop.supervision.flags
    )
    assert loop.supervision.reaction is Reaction.HOLD_MOTION


@pytest.mark.parametrize(
    ("name", "reaction"),
    [
        ("drive_fault", Reaction.QUICK_STOP),
        ("following_error", Reaction.QUICK_STOP),
        ("start_check", Reaction.PASS_THROUGH),
    ],
)
def test_what_the_rig_reports_is_answered(name: str, reaction: Reaction) -> None:
    loop = HysteresisReduction(config())
    before = loop.step(REST)
    loop.raise_flag(name)
    assert loop.supervision.reaction is reaction
    moved = loop.step(REST + 1e-4) - before
    assert (moved == 0.0).all() == (reaction is Reaction.QUICK_STOP)
    loop.engage()
    assert loop.supervision.reaction is Reaction.NONE


def test_commands_stay_within_travel_and_nothing_winds_up() -> None:
    travel = ((0.0, 0.03), (-1.0, 1.0), (0.0, 2.0))
    loop = HysteresisReduction(config(command_travel=travel))
    reached = [loop.step(REST + np.array([1e-4, 0.0, 0.0]) * tick) for tick in range(100)]
    assert max(command[0] for command in reached) == 0.03
    assert "monitor" in loop.supervision.flags
    back = loop.step(REST + np.array([1e-4, 0.0, 0.0]) * 98)
    assert back[0] < 0.03, "the first step back moves"


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ConfigError) as error:
        config(off=["frost"])
    assert error.value.field == "safety.off[0]"
    with pytest.raises(ConfigError, match="flag"):
        HysteresisReduction(config()).raise_flag("frost")
    with pytest.raises(ConfigError, match="state_noise"):
        config(state_noise=[1e-3, 1e-3, 1e-3])


def test_reactions_are_in_order() -> None:
    assert [reaction.rank for reaction in Reaction] == list(range(8))


def test_a_checksum_tells_one_noise_from_another() -> None:
    noise = np.random.default_rng(0).integers(0, 4, (2, 576, 720, 3), dtype=np.uint8)
    assert checksum(noise[0]) == checksum(noise[0].copy()) != checksum(noise[1])
