"""The hardware rig with fake motors and a fake camera; no test asserts real times."""

import itertools
import signal
import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fake_rig import CYCLE, HOME, FakeMotors, Setup, rig_config
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import (
    EMERGENCY_STOP,
    CameraError,
    ConfigError,
    DriveError,
    FollowingError,
    MotionHeldError,
    SignalError,
    StateError,
    may_move,
    notes,
)
from tautscope.hardware.experiment import run_on_hardware
from tautscope.hardware.rig import HardwareRig
from tautscope.hardware.signals import exit_on_signals
from tautscope.hardware.timing import Timing, read_sent
from tautscope.log.reader import read_log
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.rig import Rig, apply_reaction
from tautscope.loop.safety import Reaction
from tautscope.runs.experiment import HELD_TIME
from waiting import until


@pytest.fixture
def setup() -> Iterator[Callable[..., Setup]]:
    """Make rigs that are closed at the end."""
    made: list[Setup] = []

    def make(**changes: Any) -> Setup:
        made.append(Setup(**changes))
        return made[-1]

    yield make
    for one in made:
        one.rig.close()


def test_hardware_rig_implements_rig(setup: Callable[..., Setup]) -> None:
    rig = setup().rig
    assert isinstance(rig, Rig)
    assert rig.control_period == CYCLE


def test_move_to_start_respects_the_start_speed(
    setup: Callable[..., Setup],
) -> None:
    one = setup(drives={"start_speed": 0.5})
    sample = one.rig.reset()
    sent = np.array(one.motors.commands)
    centres = [one.config.experiment[dof].centre for dof in Dof]
    np.testing.assert_allclose(sent[0], HOME)
    np.testing.assert_allclose(sample.applied, centres)
    assert one.config.drives is not None
    fastest = np.abs(np.diff(sent, axis=0)).max(axis=0) / CYCLE
    limits = [one.config.drives[dof].speed_limit for dof in Dof]
    assert (fastest <= 0.5 * np.array(limits) * (1 + 1e-9)).all()
    assert (fastest / limits).max() > 0.2  # but does not take for ever
    assert sample.time == 0.0


def test_a_stop_while_the_drives_are_opened_leaves_them_off(
    setup: Callable[..., Setup], monkeypatch: pytest.MonkeyPatch
) -> None:
    one, enabled = setup(), list[str]()
    monkeypatch.setattr(FakeMotors, "start", lambda motors: enabled.append("on"))

    def open_and_stop() -> FakeMotors:
        one.rig.interrupt()
        return one.motors

    one.rig._open_motors = open_and_stop  # type: ignore[method-assign]
    with pytest.raises(StateError, match="after the stop"):
        one.rig.reset()
    assert not enabled


def test_a_second_ctrl_c_does_not_hide_a_stop_that_is_not_confirmed(
    setup: Callable[..., Setup], monkeypatch: pytest.MonkeyPatch
) -> None:
    one, text = setup(), f"rotation, node 2: quick stop is not confirmed. {EMERGENCY_STOP}"

    def stop_without_confirmation(*_: object) -> None:
        signal.raise_signal(signal.SIGINT)
        time.sleep(0.2)
        raise StateError("rotation, node 2", "quick stop is not confirmed", EMERGENCY_STOP)

    monkeypatch.setattr(FakeMotors, "__exit__", stop_without_confirmation)
    one.rig.reset()
    with pytest.raises(KeyboardInterrupt) as found, exit_on_signals():
        try:
            raise KeyboardInterrupt
        finally:
            one.rig.close()
    assert may_move(found.value)
    assert notes(found.value) == [text]


def test_each_command_is_sent_once_in_order_by_one_thread(setup: Callable[..., Setup]) -> None:
    one = setup()
    start = one.rig.reset().applied
    commands = [start + step * np.array([1e-4, 1e-3, 1e-3]) for step in range(30)]
    before = len(one.motors.commands)
    times = [one.rig.step(command).time for command in commands]
    np.testing.assert_allclose(times, CYCLE * np.arange(1, 31))
    sent = one.motors.commands[before:]
    changes = [sent[0]] + [b for a, b in pairwise(sent) if not np.array_equal(a, b)]
    np.testing.assert_array_equal(changes, commands)
    assert one.motors.threads == {"set-points"}
    assert len(one.rig.timing.sent) == 30


def test_late_loop_holds_the_set_point(setup: Callable[..., Setup]) -> None:
    one = setup()
    start = one.rig.reset().applied
    one.rig.step(start)
    before = one.rig.step(start + 1e-4)
    count = len(one.motors.commands)
    while len(one.motors.commands) < count + 8:
        time.sleep(CYCLE)
    after = one.rig.step(start + 2e-4)
    assert after.time == pytest.approx(before.time + CYCLE)
    for held in one.motors.commands[count : count + 8]:
        np.testing.assert_array_equal(held, start + 1e-4)
    assert one.rig.timing.held >= 8
    assert one.rig.timing.lost >= 8


def test_late_set_point_thread_skips_cycles(setup: Callable[..., Setup]) -> None:
    one = setup()
    start = one.rig.reset().applied
    one.rig.step(start)
    one.motors.meanwhile = lambda: time.sleep(3.5 * CYCLE)
    one.rig.step(start)
    one.motors.meanwhile = lambda: None
    for _ in range(5):
        one.rig.step(start)
    cycles = one.rig.timing.cycles
    steps = np.diff(cycles[:, 0]) / CYCLE
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    assert steps.min() == pytest.approx(1.0)
    assert one.rig.timing.skipped >= 2
    assert round(steps.sum()) + 1 == len(cycles) + one.rig.timing.skipped
    assert (one.rig.timing.jitter >= 0).all()


def test_capture_times_follow_the_set_point_in_force(setup: Callable[..., Setup]) -> None:
    one = setup()
    start = one.rig.reset().applied
    for _ in range(6):
        one.rig.step(start)
    sent = one.rig.timing.sent
    assert one.rig.to_rig_time(sent[2]) == pytest.approx(2 * CYCLE, abs=1e-9)
    assert one.rig.to_rig_time(sent[3] + 0.4 * CYCLE) == pytest.approx(3.4 * CYCLE, abs=1e-9)
    assert one.rig.to_rig_time(sent[5] + 20 * CYCLE) == pytest.approx(6 * CYCLE, abs=1e-9)
    assert one.rig.to_rig_time(sent[0] - 1.0) == pytest.approx(-1.0, abs=1e-9)
    one.camera.provide(sent[4] + 0.5 * CYCLE, 7, sequence=3)
    frame = one.rig.step(start).frame
    assert frame is not None
    assert frame.captured_at == pytest.approx(4.5 * CYCLE, abs=1e-9)
    assert frame.sequence == 3
    ages = one.rig.timing.frame_age
    assert len(ages) == 1
    assert ages[0] > 0


def test_repeated_image_is_not_a_new_frame(setup: Callable[..., Setup]) -> None:
    one = setup()
    start = one.rig.reset().applied
    is_new = []
    for value in (1, 2, 2, 2, 3):
        one.camera.provide(time.monotonic(), value)
        is_new.append(one.rig.step(start).frame is not None)
    assert is_new == [True, True, False, False, True]


@pytest.mark.parametrize("how", ["nothing", "frozen"])
def test_lost_camera_ends_the_run(setup: Callable[..., Setup], how: str) -> None:
    one = setup(source={"timeout": 0.07, "lost_timeout": 0.2})
    start = one.rig.reset().applied
    what = "only repetitions of one image" if how == "frozen" else "no image"
    with pytest.raises(CameraError, match=f"{what}.*the motors are stopped"):
        for _ in range(1000):
            if how == "frozen":
                one.camera.provide(time.monotonic(), 1)
            one.rig.step(start)
    assert one.motors.stopped == one.camera.closed == 1


def test_camera_problem_is_reported_at_its_begin_and_end(setup: Callable[..., Setup]) -> None:
    one = setup()
    start = one.rig.reset().applied
    one.warnings.clear()
    for value, trouble in enumerate(["", "unplugged", "unplugged", "", ""]):
        one.camera.trouble = trouble
        one.camera.provide(time.monotonic(), value)
        one.rig.step(start)
    assert one.warnings == ["camera: unplugged", "camera: new frames again"]


def test_drive_errors_stop_the_motors_and_propagate(
    setup: Callable[..., Setup],
) -> None:
    one = setup()
    start = one.rig.reset().applied

    def fail() -> None:
        raise FollowingError("insertion, node 1", "it is stuck", "See what holds it")

    one.motors.meanwhile = fail
    with pytest.raises(FollowingError, match="it is stuck"):
        for _ in range(100):
            one.rig.step(start)
    assert one.motors.stopped == one.camera.closed == 1
    with pytest.raises(SignalError, match="closed"):
        one.rig.step(start)


def test_missing_commands_end_in_quick_stop(setup: Callable[..., Setup]) -> None:
    one = setup(drives={"command_timeout": 0.05})
    start = one.rig.reset().applied
    end = time.monotonic() + 60
    while not one.motors.stopped and time.monotonic() < end:
        time.sleep(CYCLE)
    assert one.motors.stopped == 1
    with pytest.raises(StateError, match=r"loop: no command for .* drives.command_timeout"):
        one.rig.step(start)


def timed_out(one: Setup) -> None:
    """Run until the motors are stopped for lack of commands."""
    one.rig.step(one.rig.reset().applied)
    until(lambda: bool(one.motors.stopped))


def test_late_close_after_a_run_is_not_an_error(setup: Callable[..., Setup]) -> None:
    one = setup(drives={"command_timeout": 0.05})
    timed_out(one)
    one.rig.close()
    assert one.motors.stopped == 1
    assert one.rig.timing.lost == 0


def test_late_close_is_an_error_if_the_quick_stop_was_not_confirmed(
    setup: Callable[..., Setup],
) -> None:
    def stop() -> None:
        raise StateError(
            "rotation, node 2", "quick stop is not confirmed", "Use the emergency stop"
        )

    one = setup(drives={"command_timeout": 0.05})
    one.motors.stop = stop  # type: ignore[method-assign]
    timed_out(one)
    with pytest.raises(StateError, match="rotation, node 2: quick stop is not confirmed"):
        one.rig.close()


def test_motors_that_were_stopped_before_are_not_said_to_be_without_power(
    setup: Callable[..., Setup],
) -> None:
    one = setup(drives={"command_timeout": 0.05})
    timed_out(one)
    with pytest.raises(DriveError, match=r"loop: disable \(drive_fault\)") as found:
        apply_reaction(
            one.rig,
            SimpleNamespace(reaction=Reaction.DISABLE, flags=("drive_fault",)),  # type: ignore[arg-type]
        )
    assert one.motors.disabled == 0
    assert "without power" not in str(found.value)
    assert "voltage is not disabled" in str(found.value.__notes__)


def test_rig_can_restart_after_close(setup: Callable[..., Setup]) -> None:
    one = setup()
    one.rig.close()
    one.rig.step(one.rig.reset().applied)
    one.rig.close()
    one.rig.close()
    assert one.motors.stopped == one.camera.closed == 1
    assert not [t for t in threading.enumerate() if t.name == "set-points"]
    sample = one.rig.step(one.rig.reset().applied)
    assert sample.time == CYCLE
    assert len(one.rig.timing.sent) == 1


@pytest.mark.parametrize(("raised", "disabled"), [(1, 0), (2, 1)], ids=["quick_stop", "disable"])
def test_supervisor_reaction_reaches_the_drives_in_the_same_tick(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, raised: int, disabled: int
) -> None:
    """No frame arrives: the tick reacts. A second drive fault escalates to disable."""
    one = Setup()
    config = one.config.replace(**{"safety.hold_time": 0.0, "safety.hold_travel": 0.0})
    step, ticks = HysteresisReduction.step, itertools.count(1)

    def step_with_fault(loop: HysteresisReduction, *values: Any, **more: Any) -> Any:
        if next(ticks) == 20:
            for _ in range(raised):
                loop.raise_flag("drive_fault")
        return step(loop, *values, **more)

    monkeypatch.setattr(HysteresisReduction, "step", step_with_fault)
    message = r"loop: disable \(drive_fault\).*without power" if disabled else r"loop: quick_stop"
    with pytest.raises(DriveError, match=message):
        run_on_hardware(config, tmp_path / "run", lambda share: None, make_rig=lambda _: one.rig)
    assert (one.motors.stopped, one.motors.disabled, one.camera.closed) == (1, disabled, 1)
    assert next(ticks) == 21  # no further tick
    told = read_log(tmp_path / "run" / "compensated.mcap").warnings
    assert len([one for one in told if "DriveError: loop: " in one]) == 1
    assert "The log of the run" not in str(told)


def test_held_motion_ends_the_run_and_stops_the_motors(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    one = Setup()
    step, ticks = HysteresisReduction.step, itertools.count(1)

    def step_with_flag(loop: HysteresisReduction, *values: Any, **more: Any) -> Any:
        if next(ticks) == 20:
            loop.raise_flag("command_jump")
        return step(loop, *values, **more)

    monkeypatch.setattr(HysteresisReduction, "step", step_with_flag)
    folder = tmp_path / "run"
    with pytest.raises(MotionHeldError, match=r"hold_motion: command_jump") as caught:
        run_on_hardware(one.config, folder, lambda share: None, make_rig=lambda _: one.rig)
    assert (one.motors.stopped, one.camera.closed) == (1, 1)
    log = folder / "compensated.mcap"
    note = f"The log of the run is {log}: `tautscope report {log}`"
    assert caught.value.__notes__ == [note]
    ticks_recorded = len(caught.value.recording.trace)
    assert ticks_recorded == 20 + round(HELD_TIME / one.config.control.period)


def test_configuration_without_matching_drives_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"drives: .*a section \[drives\]"):
        HardwareRig(Config())
    with pytest.raises(ConfigError, match=r"control.period: got 0.005, expected drives.cycle"):
        HardwareRig(rig_config(period=0.005))


def test_timing_round_trip(tmp_path: Any) -> None:
    timing = Timing(CYCLE)
    for place, is_new in ((0, True), (1, False), (4, True), (5, False)):
        due = place * CYCLE
        timing.add_cycle(due, due + 0.001, due + 0.003, is_new)
    timing.add_frame(1.0, 1.08, 1.09)
    timing.write(tmp_path)
    np.testing.assert_allclose(read_sent(tmp_path / "timing_cycles.csv"), [0.001, 0.041])
    summary = timing.summary()
    assert (summary["cycles"], summary["lost_cycles"], summary["held_cycles"]) == (5, 3, 1)
    assert summary["jitter_ms"]["worst"] == pytest.approx(1.0)
    assert summary["answer_ms"]["median"] == pytest.approx(2.0)
    assert summary["frame_age_ms"]["median"] == pytest.approx(90.0)
