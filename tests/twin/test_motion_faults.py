"""Faults of drives, encoders, control tick, plant and operator input."""

import math

import numpy as np
import pytest
from faulty_runs import (
    CENTRE,
    CONFIG,
    DURATION,
    NOMINAL,
    PERIOD,
    SEED,
    START,
    FeatureTwin,
    command,
    fault,
    run,
)
from tautscope.dof import Dof
from tautscope.twin.faults import FaultyReference, FaultyRig

LAG = 4 * 0.012 * PERIOD


def motor_positions(name, dof=Dof.INSERTION, **changes):
    """Time since the fault [s], true, measured and fault-free position of a motor."""
    twin = FeatureTwin()
    rig = FaultyRig(twin, (fault(name, dof=dof, **changes),), SEED)
    rig.reset()
    table = []
    while twin.time < START + DURATION - PERIOD:
        sample = rig.step(command(twin.time))
        true, nominal = twin.plant.applied[dof], NOMINAL[len(table) + 1].applied[dof]
        table.append((sample.time - START, true, sample.applied[dof], nominal))
    return np.array(table).T


def test_axis_off_and_stuck_hold_and_only_off_reports_a_fault():
    for name, is_reported in (("axis_off", True), ("axis_stuck", False)):
        elapsed, position, measured, _ = motor_positions(name)
        np.testing.assert_array_equal(position, measured)
        assert np.ptp(position[elapsed > 0.02]) < LAG
        rig = FaultyRig(FeatureTwin(), (fault(name, start=0.0),), SEED)
        rig.reset()
        assert rig.drive_fault is is_reported


@pytest.mark.parametrize("dof", list(Dof))
def test_only_the_named_axis_fails(dof):
    collected = run(fault("axis_stuck", dof=dof), seconds=START + DURATION)
    counts = np.abs(collected[-1].applied - NOMINAL[round((START + DURATION) / PERIOD)].applied)
    counts /= CONFIG.twin.drives.encoder_step
    for other in Dof:
        # The motors are slightly coupled through the shaft.
        assert bool(counts[other] > 100) is (other is dof), counts


def test_axis_some_catches_up_and_axis_late_follows():
    elapsed, position, _, nominal = motor_positions("axis_some", severity=0.1)
    lag = nominal - position
    assert lag[(elapsed > 0.05) & (elapsed < 0.1)].min() > 4e-4
    assert np.abs(lag[(elapsed > 0.15) & (elapsed < 0.2)]).max() < LAG
    elapsed, position, _, nominal = motor_positions("axis_late", severity=0.1)
    late = np.interp(elapsed - 0.1, elapsed, nominal)
    assert np.abs(position - late)[elapsed > 0.15].max() < LAG


def test_axis_slow_limited_reversed_scaled_runs():
    elapsed, position, _, nominal = motor_positions("axis_slow", severity=2.0)
    speed = np.polyfit(elapsed[elapsed > 0.05], position[elapsed > 0.05], 1)[0]
    assert speed == pytest.approx(2e-3, rel=0.05)
    at = np.interp(0, elapsed, nominal)
    elapsed, position, _, _ = motor_positions("axis_limited", severity=1.0)
    assert position[-1] == pytest.approx(at + 1e-3, abs=LAG)
    elapsed, position, _, nominal = motor_positions("axis_reversed")
    np.testing.assert_allclose((position + nominal)[elapsed > 0.05], 2 * at, atol=2 * LAG)
    elapsed, position, measured, nominal = motor_positions("axis_scaled", severity=2.0)
    np.testing.assert_allclose(
        (position - at)[elapsed > 0.05], 2 * (nominal - at)[elapsed > 0.05], atol=3e-4
    )
    np.testing.assert_allclose(measured[elapsed > 0.05], nominal[elapsed > 0.05], atol=3e-4)
    elapsed, position, _, _ = motor_positions("axis_runs", severity=20.0)
    assert abs(position[-1] - at) == pytest.approx(20e-3 * elapsed[-1], rel=0.1)
    _, position, _, nominal = motor_positions("axis_shaking", severity=1.0)
    assert 2e-4 < np.std(position - nominal) < 1e-3


def test_encoder_faults():
    elapsed, position, measured, nominal = motor_positions(
        "encoder_jump", severity=5.0, duration=math.inf
    )
    settled = elapsed > 0.1
    assert np.abs(np.abs(position - nominal)[settled] - 5e-3).max() < LAG
    np.testing.assert_allclose(measured[settled], nominal[settled], atol=LAG)
    elapsed, position, measured, nominal = motor_positions("encoder_stuck")
    np.testing.assert_array_equal(position, nominal)
    assert np.ptp(measured[elapsed >= 0]) == 0
    _, position, measured, nominal = motor_positions("encoder_noisy", severity=5.0)
    np.testing.assert_array_equal(position, nominal)
    assert 1e-3 < np.abs(measured - position).max() <= 5e-3


@pytest.mark.parametrize("name", ["ok", "axis_reversed", "axis_runs", "encoder_stuck"])
def test_brakes_hold_the_motors(name):
    twin = FeatureTwin()
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


def test_a_stall_skips_control_ticks():
    times = np.array([s.time for s in run(fault("stall", severity=0.3, duration=math.inf))])
    gaps = np.diff(times)
    assert (gaps > 1.5 * PERIOD).sum() == 1
    assert gaps.max() == pytest.approx(0.3 + PERIOD)
    gaps = np.diff([s.time for s in run(fault("stalls", severity=0.05))])
    assert (gaps > 1.5 * PERIOD).sum() == 2


def test_clock_faults_change_the_reported_times():
    jumps = {"clock_ahead": 10.0, "clock_back": -10.0}
    for name, jump in jumps.items():
        collected = run(fault(name, severity=10.0, duration=math.inf))
        for actual, expected in zip(collected, NOMINAL, strict=True):
            late = expected.time >= START
            assert actual.time == pytest.approx(expected.time + jump * late)
            if actual.frame is not None:
                assert actual.frame.captured_at == pytest.approx(actual.time)
    collected = run(fault("clock_slow", severity=0.5))
    assert collected[-1].time == pytest.approx(NOMINAL[-1].time - 0.5 * DURATION)


def test_plant_faults_change_and_restore_the_plant():
    def plant(name, seconds, **changes):
        twin = FeatureTwin()
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
    nominal = NOMINAL[round(during / PERIOD)].true_state[0]
    assert pushed.plant.true_state[0] > nominal + 1e-3, "pushed outwards"
    assert plant("tissue_pushes", after).plant.tip_force == 0.0
    assert plant("tissue_jerks", START + 0.1, severity=3.0).plant.tip_force == 3.0
    assert plant("tissue_jerks", START + 0.3, severity=3.0).plant.tip_force == 0.0


class Ramp:
    """A reference that inserts at 10 mm/s."""

    duration = 2.0
    segments = ()

    def __call__(self, time):
        return CENTRE + 0.01 * time * np.eye(3)[0]


def reference_error(name, **changes):
    """Time since the fault [s] and error of the faulty reference [m]; outside it must be 0."""
    faulty = FaultyReference(Ramp(), (fault(name, **changes),), SEED)
    times = np.arange(0, 1.2, PERIOD)
    error = np.array([faulty(t)[0] - Ramp()(t)[0] for t in times])
    during = (times >= START) & (times < START + DURATION)
    if math.isfinite(faulty._states[0].spec.duration):
        assert np.all(error[~during] == 0)
    return times[during] - START, error[during]


def test_operator_input_faults():
    _, error = reference_error("hand_step", severity=5.0)
    assert np.ptp(error) < 1e-9
    assert abs(error[0]) == pytest.approx(5e-3)
    _, error = reference_error("hand_displaced", severity=5.0, duration=math.inf)
    assert abs(error[0]) == pytest.approx(5e-3)
    _, error = reference_error("hand_spikes", severity=5.0)
    assert (np.abs(error) > 1e-9).sum() == 2
    elapsed, error = reference_error("hand_fast", severity=100.0)
    np.testing.assert_allclose(np.abs(error), 0.1 * elapsed, atol=1e-12)
    elapsed, error = reference_error("hand_silent")
    np.testing.assert_allclose(error, -0.01 * elapsed, atol=1e-12)
    elapsed, error = reference_error("hand_late", severity=0.1)
    np.testing.assert_allclose(error, -0.01 * np.minimum(elapsed, 0.1), atol=1e-4)
    elapsed, error = reference_error("hand_slow", severity=5.0)
    assert len(np.unique(np.round(error + 0.01 * elapsed, 9))) == 2
    _, error = reference_error("hand_nan")
    assert not np.isfinite(error).any()
    _, error = reference_error("hand_noisy", severity=1.0)
    assert 3e-4 < np.std(error) < 1e-3
    _, error = reference_error("hand_tremor", severity=1.0)
    assert 0.9e-3 < np.abs(error).max() <= 1e-3
    turns = (np.diff(np.sign(error)) != 0).sum()
    assert 2 * 6 * DURATION - 2 <= turns <= 2 * 12 * DURATION + 1
