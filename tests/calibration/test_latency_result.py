"""The delay of the images as a result: two estimates that disagree give none."""

import pytest
from tautscope import axes
from tautscope.calibration.delay import DelayEstimate
from tautscope.calibration.robot import RobotFit
from tautscope.commands import robot_calibration
from tautscope.commands.calibrate_latency import result
from tautscope.config import Config, load_config
from tautscope.errors import CalibrationError, ConfigError

KEY = "camera.source.delay"


def known(
    by_geometry: float | None, delay: float = 0.08, by_latency: float | None = None, hour: int = 13
) -> Config:
    """A configuration with a delay [s] that calibrations gave with standard deviations [s].

    That of the geometry was at 12 o'clock, that of the latency at another hour.
    """
    changes: dict[str, object] = {KEY: delay}
    for kind, std, at in (("geometry", by_geometry, 12), ("latency", by_latency, hour)):
        if std is not None:
            record = {"date": f"2026-11-22T{at:02}:00:00+00:00", "std": {KEY: std}}
            changes[f"calibration.{kind}"] = record
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


@pytest.mark.parametrize(("hour", "name", "std"), [(13, "latency", 0.004), (11, "geometry", 0.008)])
def test_the_delay_is_that_of_the_last_calibration(hour: int, name: str, std: float) -> None:
    config = known(0.008, by_latency=0.004, hour=hour)
    kept = result(estimate(0.01, 0.009), config, {})
    assert (kept.values[KEY], kept.std[KEY]) == (0.08, std)
    assert f"kept: that of the {name}, 80.0 ms" in kept.notes[0]
    with pytest.raises(CalibrationError, match=f"the calibration of the {name} 80.0 ms"):
        result(estimate(0.1, 0.009), config, {})


@pytest.mark.parametrize("by_geometry", [None, 0.05])
def test_no_delay_may_be_measured_as_a_small_negative_one(by_geometry: float | None) -> None:
    found = result(estimate(-0.015, 0.01), known(by_geometry, delay=0.0), {})
    assert found.values == {KEY: 0.0} and found.std == {KEY: 0.01}


@pytest.mark.parametrize(
    ("found", "named"),
    [
        (estimate(0.1, 0.01), "geometry 80.0 ms"),
        (estimate(float("nan"), float("nan"), "the probes disagree"), "the probes disagree"),
        (estimate(-0.2, 0.05), "before they are captured"),
    ],
)
def test_no_answer_is_an_error(found: DelayEstimate, named: str) -> None:
    with pytest.raises(CalibrationError, match=named):
        result(found, known(0.02), {})


@pytest.mark.parametrize(
    ("delay", "is_early", "is_old"),
    [(-0.2, True, False), (-0.02, False, False), (0.2, False, False), (0.4, False, True)],
)
def test_delays_of_a_robot_that_cannot_be_configured_are_named(
    delay: float, is_early: bool, is_old: bool
) -> None:
    values = {"measurement.delays[0]": delay, "dof.x.gain": 1.0, "dof.x.slack": 0.1}
    std = {"measurement.delays[0]": 0.02, "dof.x.gain": 0.01}
    config = axes(1, names=["x"], width_limit=1.0)
    result = robot_calibration.result("latency", RobotFit(values, std, {}, ()), config)
    assert result.values == {"measurement.delays": [max(delay, 0.0)]}
    assert any("stamped 200 ms before" in note for note in result.notes) == is_early
    asked = "set safety.frame_age to more than 0.40 s before --write"
    assert any(asked in note for note in result.notes) == is_old
    if is_old:  # and then it can be written
        with pytest.raises(ConfigError, match=r"safety\.frame_age"):
            config.replace(**result.values)
        assert config.replace(**{"safety.frame_age": 0.41}, **result.values)
