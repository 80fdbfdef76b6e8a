"""Faults of drives, encoders, tick, physics and hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from failing import (
    BARE,
    CENTRE,
    CONFIG,
    DURATION,
    PERIOD,
    SEED,
    START,
    SeenTwin,
    command,
    fault,
    run,
)
from tautscope.dof import Dof
from tautscope.twin.faults import FaultyHand, FaultyRig

LAG = 4 * 0.012 * PERIOD


def motors(name, dof=Dof.INSERTION, **changes):
    """Time since the start, where the motor is told by physics, what is read, and without fault."""
    twin = SeenTwin()
    rig = FaultyRig(twin, (fault(name, dof=dof, **changes),), SEED)
    rig.reset()
    table = []
    while twin.time < START + DURATION - PERIOD:
        sample = rig.step(command(twin.time))
        k = len(table) + 1
        table.append(
            (
                sample.time - START,
                twin.plant.applied[dof],
                sample.applied[dof],
                BARE[k].applied[dof],
            )
        )
    return np.array(table).T


def test_axis_off_and_stuck_stay_and_only_off_says_so():
    for name, says in (("axis_off", True), ("axis_stuck", False)):
        since, real, read, _ = motors(name)
        np.testing.assert_array_equal(real, read)
        assert np.ptp(real[since > 0.02]) < LAG
        rig = FaultyRig(SeenTwin(), (fault(name, start=0.0),), SEED)
        rig.reset()
        assert rig.drive_fault is says


@pytest.mark.parametrize("dof", list(Dof))
def test_only_the_named_axis_fails(dof):
    collected = run(fault("axis_stuck", dof=dof), seconds=START + DURATION)
    counts = np.abs(collected[-1].applied - BARE[round((START + DURATION) / PERIOD)].applied)
    counts /= CONFIG.twin.drives.encoder_step
    for other in Dof:
        # Motors feel each other a little, through the shaft.
        assert bool(counts[other] > 100) is (other is dof), counts


def test_axis_some_catches_up_and_axis_late_follows():
    since, real, _, free = motors("axis_some", severity=0.1)
    behind = free - real
    assert behind[(since > 0.05) & (since < 0.1)].min() > 4e-4
    assert np.abs(behind[(since > 0.15) & (since < 0.2)]).max() < LAG
    since, real, _, free = motors("axis_late", severity=0.1)
    late = np.interp(since - 0.1, since, free)
    assert np.abs(real - late)[since > 0.15].max() < LAG


def test_axis_slow_limited_reversed_scaled_runs():
    since, real, _, free = motors("axis_slow", severity=2.0)
    speed = np.polyfit(since[since > 0.05], real[since > 0.05], 1)[0]
    assert speed == pytest.approx(2e-3, rel=0.05)
    at = np.interp(0, since, free)
    since, real, _, _ = motors("axis_limited", severity=1.0)
    assert real[-1] == pytest.approx(at + 1e-3, abs=LAG)
    since, real, _, free = motors("axis_reversed")
    np.testing.assert_allclose((real + free)[since > 0.05], 2 * at, atol=2 * LAG)
    since, real, read, free = motors("axis_scaled", severity=2.0)
    np.testing.assert_allclose((real - at)[since > 0.05], 2 * (free - at)[since > 0.05], atol=3e-4)
    np.testing.assert_allclose(read[since > 0.05], free[since > 0.05], atol=3e-4)
    since, real, _, _ = motors("axis_runs", severity=20.0)
    assert abs(real[-1] - at) == pytest.approx(20e-3 * since[-1], rel=0.1)
    _, real, _, free = motors("axis_shaking", severity=1.0)
    assert 2e-4 < np.std(real - free) < 1e-3


def test_encoders_that_lie():
    since, real, read, free = motors("encoder_jump", severity=5.0, duration=math.inf)
    settled = since > 0.1
    assert np.abs(np.abs(real - free)[settled] - 5e-3).max() < LAG
    np.testing.assert_allclose(read[settled], free[settled], atol=LAG)
    since, real, read, free = motors("encoder_stuck")
    np.testing.assert_array_equal(real, free)
    assert np.ptp(read[since >= 0]) == 0
    _, real, read, free = motors("encoder_noisy", severity=5.0)
    np.testing.assert_array_equal(real, free)
    assert 1e-3 < np.abs(read - real).max() <= 5e-3


@pytest.mark.parametrize("name", ["ok", "axis_reversed", "axis_runs", "encoder_stuck"])
def test_with_the_brakes_on_motors_stay_where_they_are(name):
    twin = SeenTwin()
    rig = FaultyRig(twin, (fault(name, start=0.0),), SEED)
    rig.reset()
    for tick in range(40):
        rig.step(command(tick * PERIOD))
    at = twin.plant.applied
    assert (at - CENTRE)[0] > 1e-3 or name != "ok"
    rig.brake()
    for tick in range(40, 120):
        rig.step(command(tick * PERIOD))
    assert (np.abs(twin.plant.applied - at) < np.array([LAG, 0.1, 0.05])).all()


def test_a_stall_lets_time_pass_at_once_and_physics_go_on():
    times = np.array([s.time for s in run(fault("stall", severity=0.3, duration=math.inf))])
    gaps = np.diff(times)
    assert (gaps > 1.5 * PERIOD).sum() == 1
    assert gaps.max() == pytest.approx(0.3 + PERIOD)
    gaps = np.diff([s.time for s in run(fault("stalls", severity=0.05))])
    assert (gaps > 1.5 * PERIOD).sum() == 2


def test_the_clock_jumps_and_runs_slow_while_true_time_does_not():
    jumps = {"clock_ahead": 10.0, "clock_back": -10.0}
    for name, jump in jumps.items():
        collected = run(fault(name, severity=10.0, duration=math.inf))
        for got, expected in zip(collected, BARE, strict=True):
            late = expected.time >= START
            assert got.time == pytest.approx(expected.time + jump * late)
            if got.frame is not None:
                assert got.frame.captured_at == pytest.approx(got.time)
    collected = run(fault("clock_slow", severity=0.5))
    assert collected[-1].time == pytest.approx(BARE[-1].time - 0.5 * DURATION)


def test_physics_acts_on_the_plant_and_is_given_back():
    def plant(name, seconds, **changes):
        twin = SeenTwin()
        run(fault(name, **changes), seconds=seconds, twin=twin)
        return twin

    during, after = START + 0.3, START + DURATION + 0.1
    assert plant("straightens", during, severity=1.0).bends == pytest.approx(4 - 3 * 0.3, abs=0.05)
    assert plant("straightens_suddenly", during, severity=1.0).bends == 1.0
    assert plant("winds", during, severity=6.0).bends == pytest.approx(4 + 2 * 0.06, abs=0.01)
    assert plant("straightens", after).bends == CONFIG.twin.bends
    assert plant("section_stiff", during, severity=2.0).plant.section_friction == 2.0
    assert plant("section_stiff", after, severity=2.0).plant.section_friction == 1.0
    pushed = plant("tissue_pushes", during, severity=4.0)
    assert pushed.plant.tip_force == 4.0
    free = BARE[round(during / PERIOD)].true_state[0]
    assert pushed.plant.true_state[0] > free + 1e-3, "pushed outwards"
    assert plant("tissue_pushes", after).plant.tip_force == 0.0
    assert plant("tissue_jerks", START + 0.1, severity=3.0).plant.tip_force == 3.0
    assert plant("tissue_jerks", START + 0.3, severity=3.0).plant.tip_force == 0.0


class Line:
    """A hand at 10 mm/s."""

    duration = 2.0
    segments = ()

    def __call__(self, time):
        return CENTRE + 0.01 * time * np.eye(3)[0]


def hand(name, **changes):
    """Times since the start, and how far the device is off the hand [m]; outside it is not."""
    faulty = FaultyHand(Line(), (fault(name, **changes),), SEED)
    times = np.arange(0, 1.2, PERIOD)
    off = np.array([faulty(t)[0] - Line()(t)[0] for t in times])
    inside = (times >= START) & (times < START + DURATION)
    if math.isfinite(faulty._moments[0].fault.duration):
        assert np.all(off[~inside] == 0)
    return times[inside] - START, off[inside]


def test_the_hand():
    _, off = hand("hand_step", severity=5.0)
    assert np.ptp(off) < 1e-9
    assert abs(off[0]) == pytest.approx(5e-3)
    _, off = hand("hand_displaced", severity=5.0, duration=math.inf)
    assert abs(off[0]) == pytest.approx(5e-3)
    _, off = hand("hand_spikes", severity=5.0)
    assert (np.abs(off) > 1e-9).sum() == 2
    since, off = hand("hand_fast", severity=100.0)
    np.testing.assert_allclose(np.abs(off), 0.1 * since, atol=1e-12)
    since, off = hand("hand_silent")
    np.testing.assert_allclose(off, -0.01 * since, atol=1e-12)
    since, off = hand("hand_late", severity=0.1)
    np.testing.assert_allclose(off, -0.01 * np.minimum(since, 0.1), atol=1e-4)
    since, off = hand("hand_slow", severity=5.0)
    assert len(np.unique(np.round(off + 0.01 * since, 9))) == 2
    _, off = hand("hand_nan")
    assert not np.isfinite(off).any()
    _, off = hand("hand_noisy", severity=1.0)
    assert 3e-4 < np.std(off) < 1e-3
    _, off = hand("hand_tremor", severity=1.0)
    assert 0.9e-3 < np.abs(off).max() <= 1e-3
    turns = (np.diff(np.sign(off)) != 0).sum()
    assert 2 * 6 * DURATION - 2 <= turns <= 2 * 12 * DURATION + 1
