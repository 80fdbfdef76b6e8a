"""The delay of the images as a result: two estimates that disagree give none."""

import pytest
from tautscope import axes
from tautscope.calibration.delay import DelayEstimate
from tautscope.calibration.robot import RobotFit
from tautscope.commands import robot_calibration
from tautscope.commands.calibrate_latency import result
from tautscope.config import Config, load_config
from tautscope.errors import CalibrationError

KEY = "camera.source.delay"


def known(by_geometry: float | None, delay: float = 0.08) -> Config:
    """A configuration with a delay [s] that the geometry gave with a standard deviation [s]."""
    changes: dict[str, object] = {KEY: delay}
    if by_geometry is not None:
        changes["calibration.geometry"] = {
            "date": "2026-11-22T12:00:00+00:00",
            "std": {KEY: by_geometry},
        }
    return load_config().replace(**changes)


def estimate(delay: float, std: float, reason: str = "") -> DelayEstimate:
    return DelayEstimate(delay, std, 0.0, 0.0, reason)


@pytest.mark.parametrize(
    ("by_geometry", "found", "expected"),
    [
        (None, (0.02, 0.01), (0.10, 0.01)),
        (0.02, (0.02, 0.01), (0.10, 0.01)),
        (0.005, (0.02, 0.01), (0.08, 0.005)),
    ],
)
def test_the_better_known_delay_is_kept(
    by_geometry: float | None, found: tuple[float, float], expected: tuple[float, float]
) -> None:
    kept = result(estimate(*found), known(by_geometry), {})
    assert (kept.values[KEY], kept.std[KEY]) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("found", "named"),
    [
        (estimate(0.1, 0.01), "geometry 80.0 ms"),
        (estimate(float("nan"), float("nan"), "the probes disagree"), "the probes disagree"),
        (estimate(-0.09, 0.05), "before they are captured"),
    ],
)
def test_no_answer_is_an_error(found: DelayEstimate, named: str) -> None:
    with pytest.raises(CalibrationError, match=named):
        result(found, known(0.02), {})


@pytest.mark.parametrize(("delay", "is_early"), [(-0.2, True), (-0.02, False), (0.2, False)])
def test_stamps_of_a_robot_that_are_early_are_named(delay: float, is_early: bool) -> None:
    values = {"measurement.delays[0]": delay, "dof.x.gain": 1.0, "dof.x.slack": 0.1}
    std = {"measurement.delays[0]": 0.02, "dof.x.gain": 0.01}
    config = axes(1, names=["x"], width_limit=1.0)
    result = robot_calibration.result("latency", RobotFit(values, std, {}, ()), config)
    assert result.values == {"measurement.delays": [max(delay, 0.0)]}
    assert any("stamped 200 ms before" in note for note in result.notes) == is_early
