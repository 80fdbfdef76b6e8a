"""Table 1 from two synthetic runs with known figures."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from play_model import play
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.references import Segment
from tautscope.report import metrics
from tautscope.report.results import DofResult, combine, evaluate
from tautscope.runs.recording import Recording, trace_columns, update_columns

START = 100.0  # the rig's clock need not begin at 0
TIME = np.arange(7000) * 1e-3  # the segment: 1 s to 6 s
SEGMENT = Segment(Dof.BENDING, start=1.0, period=1.0, periods=5)
REFERENCE = np.where(TIME < 6, np.sin(2 * np.pi * np.maximum(TIME - 1, 0)), 0.0)
SEEN = slice(0, None, 20)
NARROWING = np.clip((TIME - 3.25) / 0.02, 0, 1)  # quickly, at the top of the third period

Floats = NDArray[np.float64]


def recording(command: Floats, truth: Floats, estimate: Floats, compensated: bool) -> Recording:
    trace = np.zeros(len(TIME), trace_columns(Dof))
    trace["time"] = START + TIME
    trace["reference_bending"] = REFERENCE
    trace["command_bending"] = command
    trace["true_bending"] = truth
    frames = np.zeros(len(TIME[SEEN]), update_columns(Config()))
    frames["captured_at"] = START + TIME[SEEN]
    frames["status"] = "held"
    frames["estimate_bending"] = estimate[SEEN]
    frames["true_bending"] = truth[SEEN]
    frames["observable_bending"] = True
    blind = np.flatnonzero((TIME[SEEN] >= 2) & (TIME[SEEN] < 3))
    frames["observable_bending"][blind] = False
    frames["estimate_bending"][blind] = 1e3
    for name, error in (("a_x", 3.0), ("a_y", 4.0), ("b_x", 0.0), ("b_y", 0.0)):
        frames[f"features_{name}"] = 200 + error
        frames[f"true_features_{name}"] = 200
    return Recording(trace, frames, Config(), compensated, (SEGMENT,))


WIDE, NARROW = play(REFERENCE, -0.3, 0.3, 0.0), play(REFERENCE, -0.1, 0.1, 0.0)
TIP = WIDE + NARROWING * (NARROW - WIDE)


@pytest.fixture(scope="module")
def result() -> DofResult:
    still = play(REFERENCE, -0.5, 0.5, 0.0)
    seen = play(REFERENCE, -0.4, 0.4, 0.0)
    before = recording(REFERENCE, still, seen, compensated=False)
    after = recording(3 * REFERENCE, TIP, TIP + 0.02, compensated=True)
    found = evaluate(before, after)
    assert list(found) == [Dof.BENDING]
    return found[Dof.BENDING]


def test_widths_are_of_the_last_two_periods(result: DofResult) -> None:
    assert result.uncompensated == pytest.approx(1.0, rel=1e-4)
    assert result.uncompensated_max == pytest.approx(1.0, rel=1e-3)
    assert result.compensated == pytest.approx(0.2, rel=1e-3)
    assert result.compensated_max == pytest.approx(0.2, rel=1e-2)
    assert result.reduction == pytest.approx(0.8, rel=1e-3)
    assert result.reduction_max == pytest.approx(0.8, rel=1e-2)


def test_a_part_that_the_uncompensated_run_did_not_complete_is_not_compared() -> None:
    after = recording(3 * REFERENCE, TIP, TIP, compensated=True)
    before = replace(recording(REFERENCE, WIDE, WIDE, compensated=False), segments=())
    found = evaluate(before, after)[Dof.BENDING]
    assert np.isnan([found.uncompensated, found.reduction, found.uncompensated_estimate]).all()
    assert found.compensated == pytest.approx(0.2, rel=1e-3)


def test_widths_by_camera_are_of_the_estimates(result: DofResult) -> None:
    assert result.uncompensated_estimate == pytest.approx(0.8, rel=2e-2)
    assert result.compensated_estimate == pytest.approx(0.2, rel=2e-2)
    expected = 1 - result.compensated_estimate / result.uncompensated_estimate
    assert result.reduction_estimate == pytest.approx(expected)


def test_tracking_begins_after_the_start(result: DofResult) -> None:
    assert result.start_periods == 3
    settled = (TIME >= 4) & (TIME <= 6)
    expected = np.sqrt(np.mean((TIP - REFERENCE)[settled] ** 2))
    assert result.tracking_rms == pytest.approx(expected)


def test_errors_are_of_the_frames_that_measured(result: DofResult) -> None:
    assert result.state_rms == pytest.approx(0.02)
    assert result.marker_rms_px == pytest.approx(5 / np.sqrt(2))
    assert result.frames_used == pytest.approx(0.8, abs=0.01)


def test_speeds_are_of_the_whole_segment(result: DofResult) -> None:
    inside = (TIME >= 1) & (TIME <= 6)
    expected = metrics.tip_overspeed(TIME[inside], REFERENCE[inside], TIP[inside])
    assert result.tip_overspeed == pytest.approx(expected)
    assert expected > 1.2
    assert result.actuator_gain == pytest.approx(3.0)


def test_medians_and_worst_values_skip_unknown_figures() -> None:
    def result(value: float) -> dict[Dof, DofResult]:
        return {Dof.BENDING: DofResult(*[value] * len(DofResult.__dataclass_fields__))}

    results = [result(1.0), result(np.nan), result(5.0), result(2.0)]
    assert combine(results, "median")[Dof.BENDING].reduction == 2.0
    assert combine(results, "worst")[Dof.BENDING].reduction == 1.0
    assert combine(results, "worst")[Dof.BENDING].state_rms == 5.0
    assert np.isnan(combine([result(np.nan)], "median")[Dof.BENDING].state_rms)


def test_the_worst_width_is_the_farthest_from_none() -> None:
    results = [
        {Dof.BENDING: DofResult(*[width] * len(DofResult.__dataclass_fields__))}
        for width in (0.1, -3.0, 2.0)
    ]
    assert combine(results, "worst")[Dof.BENDING].compensated == -3.0
