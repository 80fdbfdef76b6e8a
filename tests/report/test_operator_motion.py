"""Figures of an operator motion from two synthetic runs with known errors."""

import numpy as np
import pytest
from tautscope.config import Config, DofEntry
from tautscope.dof import Dof
from tautscope.report.operator_motion import (
    OperatorResults,
    evaluate_operator_motion,
    motion_of,
    operator_motion,
)
from tautscope.report.tracking_bound import tracking_bound
from tautscope.runs.recording import Recording, per_dof, trace_columns, update_columns

PERIOD = 0.02
START = 100.0  # the rig's clock need not begin at 0
CONFIG = Config().replace(**{"twin.seed": 2})
TIME = np.arange(0, 120, PERIOD)
REFERENCE = np.array([operator_motion(CONFIG)(time) for time in TIME])
COUNTS = TIME >= 40


def recording(error: float, before: float, compensated: bool) -> Recording:
    """A tip with one error in the first 40 s and another after it."""
    trace = np.zeros(len(TIME), trace_columns(Dof))
    trace["time"] = START + TIME
    for dof in Dof:
        trace[f"reference_{dof.label}"] = REFERENCE[:, dof]
        trace[f"true_{dof.label}"] = REFERENCE[:, dof] + np.where(COUNTS, error, before)
    return Recording(trace, np.zeros(0, update_columns(Config())), CONFIG, compensated, ())


FREE = recording(error=-4e-3, before=1e3, compensated=False)
RUN = recording(error=1e-3, before=-1e3, compensated=True)


@pytest.fixture(scope="module")
def results() -> OperatorResults:
    return evaluate_operator_motion(FREE, RUN)


def test_the_mean_error_counts_and_the_first_40_s_do_not(results: OperatorResults) -> None:
    assert list(results) == list(Dof)
    for result in results.values():
        assert result.uncompensated_rms == pytest.approx(4e-3)
        assert result.compensated_rms == pytest.approx(1e-3)
        assert result.reduction == pytest.approx(0.75)
        assert result.largest == pytest.approx(1e-3)
        assert result.overspeed == pytest.approx(1.0, abs=0.01)
        assert result.creep == pytest.approx(0.0, abs=1e-12)


def test_largest_error_and_creep_are_of_the_compensated_run() -> None:
    run = recording(error=1e-3, before=0.0, compensated=True)
    rests = np.flatnonzero(np.all(np.diff(REFERENCE, axis=0) == 0, axis=1) & COUNTS[1:])
    assert len(rests) > 10
    run.trace["true_bending"][rests[5] + 1 :] += 0.2
    found = evaluate_operator_motion(FREE, run)
    assert found[Dof.BENDING].creep == pytest.approx(0.2)
    assert found[Dof.BENDING].largest == pytest.approx(0.201)
    assert found[Dof.ROTATION].creep == pytest.approx(0.0, abs=1e-12)


def test_the_bound_is_of_the_same_ticks(results: OperatorResults) -> None:
    expected = tracking_bound(per_dof(RUN.trace, "reference"), CONFIG, first=int(40 / PERIOD))
    assert [result.bound for result in results.values()] == list(expected)
    assert not np.array_equal(tracking_bound(REFERENCE, CONFIG), expected)


def test_by_camera_where_the_true_tip_is_not_known() -> None:
    """Errors are those of the estimates of the frames that measured the DOF, over half the run."""
    run = recording(error=0.0, before=0.0, compensated=True)
    short = run.trace[TIME < 30]
    for dof in Dof:
        short[f"true_{dof.label}"] = np.nan
    frames = np.zeros(100, update_columns(Config()))
    frames["captured_at"] = START + np.linspace(1, 29, 100)
    late = frames["captured_at"] >= START + (TIME[TIME < 30][-1]) / 2
    for dof in Dof:
        reference = np.interp(frames["captured_at"], short["time"], short[f"reference_{dof.label}"])
        frames[f"estimate_{dof.label}"] = reference + np.where(late, 2e-3, 1.0)
        frames[f"observable_{dof.label}"] = True
    frames["estimate_rotation"][-1] += 7
    frames["observable_rotation"][-1] = False
    blind = Recording(short, frames, CONFIG, True, ())
    for result in evaluate_operator_motion(None, blind).values():
        assert result.compensated_rms == pytest.approx(2e-3)
        assert result.largest == pytest.approx(2e-3)
        unknown = (result.uncompensated_rms, result.reduction, result.overspeed, result.creep)
        assert np.isnan(unknown).all()


def test_every_twin_has_its_own_motion() -> None:
    assert operator_motion(CONFIG).seed == 42
    disturbed = operator_motion(CONFIG, is_disturbed=True)
    assert disturbed.is_disturbed
    assert disturbed.experiment == CONFIG.experiment


def test_the_motion_of_another_robot_keeps_to_its_ranges_and_speeds() -> None:
    """A wide range and a small speed, and the other way round."""
    dofs = (
        DofEntry(name="slow", width_limit=0.3, range=(-1.5, 2.5)),
        DofEntry(name="near", width_limit=0.3, range=(-0.2, 0.2), speed=5.0),
    )
    motion = motion_of(Config(dof=dofs), 3, 60.0)
    time = np.arange(0.0, 60.0, PERIOD)
    moved = np.array([motion(at) for at in time])
    fastest = np.abs(np.diff(moved, axis=0)).max(axis=0) / PERIOD
    assert (fastest <= [0.6, 5.0]).all()
    np.testing.assert_allclose(fastest[0], 0.6, rtol=0.2)
    np.testing.assert_allclose(np.ptp(moved[:, 1]), 0.24, rtol=0.2)
    np.testing.assert_allclose(moved[0], [0.5, 0.0])
