"""A loop without measurements: compensation fades, which the log says, and the tip then follows as
without it."""

import logging
from collections.abc import Callable

import numpy as np
import pytest
from tautscope.config import from_document
from tautscope.loop.reduction import HysteresisReduction
from tautscope.runs.play_rig import PlayRig

DOF = {"name": "x", "unit": "m", "width_limit": 6e-3, "expected_width": 4e-3,
       "range": [-0.02, 0.02], "speed": 0.05}  # fmt: skip
LOST, END = 20.0, 60.0
CYCLE = 10.0
"""Of the reference, and of the error at the end [s]."""


def errors(compensate: bool, share: float = 1.0) -> np.ndarray:
    """Error of the tip [m] in the last cycle of 60 s, of which the tip is measured for 20 s."""
    config = from_document({"dof": [DOF]})
    rig, loop = PlayRig(config, [4e-3]), HysteresisReduction(config, compensate)
    sample, found = rig.reset(), []
    while sample.time < END:
        reference = 0.01 * np.sin(2 * np.pi * sample.time / CYCLE)
        if sample.time > LOST:
            loop.set_compensation(share)
        sample = rig.step(loop.step([reference], sample.time))
        for tip in sample.measurement:
            if tip.captured_at < LOST or share < 1:
                loop.on_tip(tip.values, tip.captured_at)
        if sample.time > END - CYCLE:
            found.append(sample.true_state[0] - reference)
    return np.array(found)


@pytest.mark.parametrize("share", [1.0, 0.0])
def test_the_tip_follows_as_without_compensation(share: float) -> None:
    """Half of the slack to each side, not all of it to one; also where it is switched off."""
    np.testing.assert_allclose(errors(True, share), errors(False), atol=1e-6)


@pytest.mark.parametrize(
    ("gap", "late", "ahead", "cause"),
    [
        (0.04, 0.0, 0.0, None),
        (np.inf, 0.0, 0.0, "safety.frame_gap"),
        (0.04, np.inf, 0.0, "safety.frame_gap"),
        (0.25, 0.0, 0.0, "safety.frame_gap"),
        (0.04, 0.4, 0.0, "frame_age"),
        (0.04, 0.0, 1e9, "clock of the camera or sensor"),
    ],
)
def test_the_log_says_once_why_nothing_is_compensated(
    gap: float, late: float, ahead: float, cause: str | None, caplog: pytest.LogCaptureFixture
) -> None:
    """A sensor that is too slow or too late, or has another clock, and one in order."""
    config = from_document({"dof": [DOF]})
    rig, loop = PlayRig(config, [4e-3]), HysteresisReduction(config)
    sample, due = rig.reset(), 0.0
    while sample.time < LOST:
        sample = rig.step(loop.step([0.01 * np.sin(sample.time)], sample.time))
        if sample.time >= due + late:
            loop.on_tip(sample.true_state, due + ahead)
            due += gap
    lines = [record.getMessage() for record in caplog.records if record.levelno == logging.WARNING]
    assert len(lines) == (cause is not None)
    assert all("Compensation fades out" in line and str(cause) in line for line in lines)


FAULTS: dict[str, Callable[[float], tuple[float, float]]] = {
    "stuck": lambda tip: (0.001, 0.0),
    "off": lambda tip: (tip + 0.02, 0.0),
    "ahead": lambda tip: (tip, 5.0),
    "late": lambda tip: (tip, -0.4),
}
"""What a sensor measures instead of the tip [m], and how much later than it is [s]."""


@pytest.mark.parametrize("fault", FAULTS)
def test_a_sensor_may_fail_where_another_one_measures_the_same(fault: str) -> None:
    config = from_document({"dof": [DOF]})
    rig, loop = PlayRig(config, [4e-3]), HysteresisReduction(config)
    sample, found = rig.reset(), []
    while sample.time < END:
        reference = 0.01 * np.sin(2 * np.pi * sample.time / CYCLE)
        sample = rig.step(loop.step([reference], sample.time))
        for tip in sample.measurement:
            loop.on_sample(tip)
            value, ahead = float(np.ravel(tip.values)[0]), 0.0
            if tip.captured_at > LOST:
                value, ahead = FAULTS[fault](value)
            loop.on_tip([value], tip.captured_at + ahead, sensor=1)
        if sample.time > END - CYCLE:
            found.append(sample.true_state[0] - reference)
    assert np.std(found) < 0.1 * np.std(errors(False))
    assert loop.supervision.lead == 1.0
    assert "frame_rate" in loop.supervision.latched


@pytest.mark.parametrize("others", [True, False], ids=["both", "each its own"])
def test_a_sensor_may_be_lost_where_another_one_measures_the_same(others: bool) -> None:
    """Of two degrees of freedom and two sensors one is lost for good: a warning, and compensation
    goes on, if the other one measures both."""
    config = from_document({"dof": [DOF, {**DOF, "name": "y"}]})
    rig, loop = PlayRig(config, [4e-3, 4e-3]), HysteresisReduction(config)
    sample, found = rig.reset(), []
    while sample.time < END:
        reference = 0.01 * np.sin(2 * np.pi * sample.time / CYCLE) * np.ones(2)
        sample = rig.step(loop.step(reference, sample.time))
        for tip in sample.measurement:
            for sensor in (0, 1) if tip.captured_at < LOST else (1,):
                own = np.where(np.arange(2) == sensor, tip.values, np.nan)
                loop.on_tip(tip.values if others else own, tip.captured_at, sensor=sensor)
        if sample.time > END - CYCLE:
            found.append(sample.true_state - reference)
    left, without = np.sqrt(np.mean(np.square(found), axis=0)), np.std(errors(False))
    if others:
        assert loop.supervision.flags == ("frame_rate",)
        assert (left < 0.2 * without).all()
    else:
        assert loop.supervision.reaction == "fade"
        np.testing.assert_allclose(left, without, rtol=0.02)


@pytest.mark.parametrize("share", [0.5, 1.2, 4.0])
def test_the_log_says_once_that_ticks_come_at_another_interval(
    share: float, caplog: pytest.LogCaptureFixture
) -> None:
    config = from_document({"dof": [DOF]})
    loop, interval = HysteresisReduction(config), share * config.control.period
    for tick in range(500):
        loop.step([1e-5 * tick], tick * interval)
        loop.on_tip([1e-5 * tick], tick * interval)
    lines = [line for line in caplog.messages if "control.period" in line]
    assert len(lines) == (share != 1.2)
    assert all(f"ticks come every {interval:.4g} s" in line for line in lines)


def test_the_log_tells_of_a_pause_and_of_each_hold(caplog: pytest.LogCaptureFixture) -> None:
    loop = HysteresisReduction(from_document({"dof": [DOF]}))
    for tick in range(900):
        pauses = tick // 300
        if tick == 450:
            loop.engage()
        loop.step([0.0], 0.005 * tick + 3600 * pauses)
        loop.on_tip([0.0], 0.005 * tick + 3600 * pauses)
    lines = [line for line in caplog.messages if "Motion is held" in line]
    assert len(lines) == len(caplog.messages) == 2
    assert all("re-engage" in line for line in lines)


@pytest.mark.parametrize("count", [1, 2])
def test_the_log_says_once_what_is_warned_of_all_the_time(
    count: int, caplog: pytest.LogCaptureFixture
) -> None:
    """A driver that gives each measurement twice, and one in order."""
    loop = HysteresisReduction(from_document({"dof": [DOF]}))
    for tick in range(4000):
        loop.step([0.0], 0.005 * tick)
        for _ in range(count):
            loop.on_tip([0.0], 0.005 * tick)
    assert len(caplog.messages) == count - 1
    assert all("duplicate for 1000 ticks" in line for line in caplog.messages)
