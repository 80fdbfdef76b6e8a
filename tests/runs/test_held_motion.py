"""A run in which motion is held: who re-engages it, and how the run ends where nobody can."""

import pickle
from collections.abc import Callable

import numpy as np
import pytest
from drawn import DrawnRig, StallingRig, short_experiment
from numpy.typing import NDArray
from tautscope.errors import MotionHeldError
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import Segment
from tautscope.loop.rig import Frame, Rig, Sample
from tautscope.loop.safety import Reaction, Supervision
from tautscope.runs.experiment import HELD_TIME, run_experiment
from tautscope.runs.recording import Recording

CONFIG = short_experiment()
PERIOD = CONFIG.control.period


class Slide:
    """A slow insertion."""

    duration = 4.0
    segments: tuple[Segment, ...] = ()

    def __call__(self, time: float) -> NDArray[np.float64]:
        return np.array([0.02 + 1e-3 * time, 0.0, 1.2])


class Ticks:
    """A log that counts what it receives."""

    def __init__(self) -> None:
        self.ticks = self.frames = 0
        self.events: list[str] = []

    def tick(self, sample: Sample, *_: object) -> None:
        self.ticks += 1

    def frame(self, now: float, frame: Frame, report: Report) -> None:
        self.frames += 1

    def event(self, now: float, what: str) -> None:
        self.events.append(what)


def run(
    rig: Rig | None = None,
    engage: Callable[[Supervision], bool] | None = None,
    log: Ticks | None = None,
) -> Recording:
    return run_experiment(rig or StallingRig(CONFIG), Slide(), CONFIG, engage=engage, log=log)


def test_a_run_that_nobody_can_re_engage_ends_with_what_was_recorded() -> None:
    log = Ticks()
    with pytest.raises(MotionHeldError) as caught:
        run(log=log)
    error = caught.value
    assert (error.reaction, error.flags) == ("hold_motion", ("late_tick",))
    trace = error.recording.trace
    assert (log.ticks, log.frames) == (len(trace), len(error.recording.frames))
    held = trace["time"] >= error.time
    assert trace["time"][-1] - error.time == pytest.approx(HELD_TIME, abs=1e-9)
    assert np.diff(trace["time"])[np.argmax(held) - 1] > StallingRig.DURATION, "since the stall"
    assert np.ptp(trace["command_insertion"][held]) == 0.0
    assert any(line.startswith("late_tick") for line in error.recording.warnings)
    again = pickle.loads(pickle.dumps(error))
    assert (again.time, again.reaction, again.flags) == (error.time, error.reaction, error.flags)
    assert again.recording.trace.tobytes() == trace.tobytes()


def test_the_message_says_what_happened_when_and_what_to_do() -> None:
    message = str(MotionHeldError(12.3456, "hold_motion", ("reference_jump", "late_tick")))
    for part in ("12.346 s", "hold_motion: reference_jump, late_tick", "docs/safety.md", "engage"):
        assert part in message


def test_the_caller_is_asked_while_motion_is_held_and_re_engages_it() -> None:
    asked: list[Supervision] = []

    def engage(supervision: Supervision) -> bool:
        asked.append(supervision)
        return len(asked) == 10

    log = Ticks()
    trace = run(engage=engage, log=log).trace
    assert len(asked) == 10
    assert {each.reaction for each in asked} == {Reaction.HOLD_MOTION}
    assert log.events == ["engage"]
    assert trace["time"][-1] == pytest.approx(Slide.duration, abs=2 * PERIOD), "to its end"
    moved = np.diff(trace["command_insertion"])
    assert np.count_nonzero(moved == 0.0) == pytest.approx(11, abs=1), "and then it moves"


def test_a_caller_who_can_engage_may_wait() -> None:
    trace = run(engage=lambda supervision: False).trace
    assert trace["time"][-1] > StallingRig.STALL + StallingRig.DURATION + 2 * HELD_TIME


def test_a_caller_who_engages_in_the_image_update_is_in_time_however_often() -> None:
    since: list[float] = []

    def look(loop: HysteresisReduction, frame: Frame) -> Report:
        if loop.supervision.reaction is not Reaction.HOLD_MOTION:
            loop.raise_flag("command_jump")
            since.append(frame.captured_at)
        elif frame.captured_at > since[-1] + 0.6 * HELD_TIME:
            loop.engage()
        return loop.on_frame(frame)

    run_experiment(DrawnRig(CONFIG), Slide(), CONFIG, look=look)
    assert len(since) > 3


def test_a_loop_that_has_to_be_restarted_ends_the_run_also_with_an_operator() -> None:
    config = CONFIG.replace(**{"safety.hold_time": 0.0})

    def look(loop: HysteresisReduction, frame: Frame) -> Report:
        if frame.captured_at > 1.0:
            loop.raise_flag("drive_fault")
        return loop.on_frame(frame)

    rig, operator = DrawnRig(config), lambda supervision: supervision.reaction is None
    with pytest.raises(MotionHeldError, match="disable: drive_fault"):
        run_experiment(rig, Slide(), config, look=look, engage=operator)
