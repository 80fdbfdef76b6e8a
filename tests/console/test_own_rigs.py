"""The console of robots with [[dof]]: a rig of one's own, the colonoscope, any number of axes."""

import multiprocessing
import re
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import own_catheter
import pytest
import tautscope
from console.pages import PERIOD
from numpy.typing import ArrayLike
from running import (
    Arm,
    Page,
    RunningConsole,
    play_all,
    player_of,
    receive_image,
    rests,
    running_console,
    small_config,
)
from tautscope.config import Config, DofEntry, load_config
from tautscope.console import log_player, paced_rig
from tautscope.console.actions import Actions
from tautscope.console.lease import ImageTimes, Lease
from tautscope.console.messages import (
    Action,
    Received,
    Reply,
    Servo,
    SetProfile,
)
from tautscope.console.operator_input import OperatorInput
from tautscope.console.paced_rig import PacedRig
from tautscope.console.rig_control import INTERRUPTED, RigControl
from tautscope.console.session import Session
from tautscope.console.session_state import session_state
from tautscope.console.shared import Channels, SharedMemory
from tautscope.console.state import LogState, State
from tautscope.errors import STOPPED, StateError
from tautscope.log.reader import Log, Request, Tick, read_log
from tautscope.log.replay import replay_same
from tautscope.loop import vision
from tautscope.loop.actuators import with_actuators
from tautscope.loop.kinematics import TwoPlanes
from tautscope.loop.rig import Rig, Sample, disable, reset_unless
from tautscope.runs.rigs import rig_maker
from tautscope.twin.colonoscope import ColonoscopeTwin
from tautscope.twin.rig import Twin

SLACK = 0.3
"""Of the catheter to each side [rad]."""


@contextmanager
def console_of(
    folder: Path, config: Config, make: Callable[[Config], Rig], *, is_twin: bool
) -> Iterator[RunningConsole]:
    rig = PacedRig(lambda: make(config), config.control.period, is_simulated=is_twin)
    with running_console(folder, config, rig) as console:
        yield console


@contextmanager
def control_of(folder: Path, arm: Rig, *, is_simulated: bool = False) -> Iterator[RigControl]:
    """Rig and loop of two axes, whose page is always present."""
    config = tautscope.axes(2, width_limit=1.0)
    with ThreadPoolExecutor(1) as executor:
        rig = PacedRig(lambda: arm, 0.005, is_simulated=is_simulated)
        control = RigControl(config, rig, folder, executor)
        control.operator.is_present = lambda now: True  # type: ignore[method-assign]
        yield control
        control.shut_down()


def session_of(control: RigControl) -> Session:
    memory = SharedMemory(multiprocessing.get_context("spawn"), control.config)
    return Session(control, Channels(memory))


def test_a_newcomers_catheter_follows_stops_replays_and_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed: list[Rig] = []

    def close(rig: Rig) -> None:
        closed.append(rig)

    monkeypatch.setattr(own_catheter.Catheter, "close", close)
    make = rig_maker("own_catheter:Catheter")
    with console_of(tmp_path, own_catheter.CONFIG, make, is_twin=False) as console:
        page, watcher = console.page(), console.page()
        page.take()
        assert page.state["mode"] == "hardware"
        assert page.state["motion"] == "off"  # motors wait for the operator
        page.servo((0.0, 0.0), is_holding=False)
        assert page.request(type="action", name="enable")["is_accepted"]
        assert page.request(type="setting", name="scale", value=1.0, dof="bend_x")["is_accepted"]
        bend(page, 1, lambda: page.state["reference"][0] > 0.9)
        bend(page, -1, lambda: page.state["reference"][0] < 0.1)
        true, reference = (np.array(page.state[name]) for name in ("true", "reference"))
        assert reference[1] == 0
        assert abs(true - reference).max() < SLACK / 2  # by itself it lags by its slack
        assert page.state["image"]["updates"] > 20
        tip, target = (page.state["positions"][name] for name in ("true", "reference"))
        assert np.hypot(*np.subtract(tip, target)[:2]) < 0.06 * SLACK / 2  # of a length of 6 cm
        page.servo((1.0, 0.0))
        watcher.send({"type": "stop"})
        page.wait(lambda: page.state["motion"] == "stopped")
        assert console.control.run is None
        assert len(closed) == 1
        # Enabled again it is a new one, and what fails in it is shown.
        page.servo((0.0, 0.0), is_holding=False)
        assert page.request(type="action", name="enable")["is_accepted"]
        page.wait(lambda: page.state["motion"] == "ready")
        monkeypatch.setattr(own_catheter.Catheter, "step", broken)
        page.wait(lambda: page.state["motion"] == "off")
        assert "rig: OSError: cable pulled" in page.state["message"]
        assert len(closed) == 2
        assert closed[0] is not closed[1]
    log = read_log(tmp_path / "console-1.mcap")
    comparison, _ = replay_same(log)
    assert comparison.ended == ""
    assert comparison.same_ticks == comparison.ticks > 100
    assert comparison.same_updates == comparison.updates > 20
    is_shown_by_the_player(log, monkeypatch)


def is_shown_by_the_player(log: Log, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page of a log has its commands, and positions by its kinematics."""
    monkeypatch.setattr(log_player, "STATE_PERIOD", 0.0)
    monkeypatch.setattr(log_player, "_IDLE_PERIOD", 1e9)
    monkeypatch.setattr(time, "sleep", lambda pause: None)  # at once
    with player_of(log) as (player, shown):
        states = play_all(player, shown)
    ticks = [event for event in log.events.values() if isinstance(event, Tick)]
    by_time = {tick.sample.time: tick for tick in ticks}
    compared = [state for state in states if state["time"] in by_time]
    assert len(compared) > 100
    kinematics = TwoPlanes(log.config)
    for state in compared:
        tick = by_time[state["time"]]
        assert np.allclose(state["command"], tick.command)
        assert np.allclose(state["positions"]["true"], kinematics.tip(tick.sample.true_state)[0])


def test_a_page_that_is_opened_after_a_stop_shows_the_last_image_and_may_enable(
    tmp_path: Path,
) -> None:
    latencies: list[Any] = []
    with console_of(tmp_path, small_config(), Twin, is_twin=False) as console:

        def enabled() -> str:
            """The reply to a new page, which names the image that it shows, if it shows one."""
            page, video = console.page(), console.page("/video")
            image, newest = 0, console.control.images.newest
            while image < newest:
                image = receive_image(video)[0]["sequence"]
            page.on_latency = latencies.append
            video.send({"type": "drawn", "image": image, "width": 180})
            rest = {"type": "servo", "axes": (0, 0, 0), "is_holding": False}

            def is_answered() -> bool:
                page.send({**rest, **page.fields(image)})  # or the page would be away
                return page.replies[-1]["what"] == "enable"

            page.take()
            page.wait(lambda: page.replies)
            assert not is_answered()
            page.send({"type": "action", "name": "enable", **page.fields(image)})
            page.wait(is_answered, PERIOD)
            reply = page.replies[-1]
            page.wait(lambda: not reply["is_accepted"] or console.control.images.newest > newest)
            page.send({"type": "stop"})
            page.wait(lambda: console.control.run is None)
            page.close()
            video.close()
            return str(reply["reason"])

        assert [enabled(), enabled()] == ["", ""]
    assert not latencies  # that of an old image is none


class Slow(Arm):
    """Its reset moves until it is interrupted, or for as long as `duration` [s]."""

    duration, is_interrupted = 20.0, False

    def reset(self) -> Sample:
        end = time.monotonic() + self.duration
        while time.monotonic() < end and not self.is_interrupted:
            time.sleep(0.001)
        if self.is_interrupted:
            raise StateError("rig", "interrupted", "Call reset() to start again")
        return super().reset()


class Interrupted(Slow):
    def interrupt(self) -> None:
        self.is_interrupted = True


@pytest.mark.parametrize("cause", ["STOP by page 2", "The page was away"])
@pytest.mark.parametrize("kind", [Interrupted, Slow])
def test_a_reset_that_moves_is_interrupted_or_not_shown_as_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: type[Slow], cause: str
) -> None:
    arm, states = kind(2), []
    monkeypatch.setattr(Slow, "duration", 0.5 if kind is Slow else 20.0)
    with control_of(tmp_path, arm) as control:

        def look() -> None:
            states.append(session_state(control, LogState(), time.monotonic()))
            if cause.startswith("STOP") and len(states) == 2:
                control.stop(cause)

        if not cause.startswith("STOP"):
            monkeypatch.setattr(control.operator, "is_present", lambda now: not states)
        control.while_opening = look
        control.open()
        assert arm.is_interrupted == (kind is Interrupted)
        assert control.run is None
        assert control.fault == INTERRUPTED
        assert (states[0].motion, states[0].drives) == ("opening", "being enabled")
        if kind is Slow:
            assert states[-1].motion == "stopped"
            assert states[-1].message == (
                f"{cause}. The rig's reset has not ended: use the emergency stop."
            )


@pytest.mark.parametrize("kind", [Interrupted, Slow])
def test_a_reset_that_could_not_be_stopped_any_more_is_stopped(
    monkeypatch: pytest.MonkeyPatch, kind: type[Slow]
) -> None:
    monkeypatch.setattr(Slow, "duration", 0.3 if kind is Slow else 20.0)
    arm, calls = kind(2), []

    def must_stop() -> bool:
        calls.append(True)
        raise ValueError("a record of 40000 bytes")

    reason = "interrupted" if kind is Interrupted else "a record of 40000 bytes"
    with pytest.raises(StateError, match=reason):
        reset_unless(arm, must_stop)
    assert arm.is_interrupted == (kind is Interrupted)
    assert len(calls) > 1 or kind is Interrupted  # it goes on: the failure may have been one


class Disabled(Arm):
    is_disabled = False

    def disable(self) -> None:
        self.is_disabled = True


def test_disabling_reaches_a_rig_that_can(tmp_path: Path) -> None:
    arm = Disabled(2)
    with control_of(tmp_path, arm) as control:
        control.open()
        control.close("monitor", is_disabling=True)
        assert arm.is_disabled


def paced(rig: Rig) -> Rig:
    return PacedRig(lambda: rig, rig.control_period, is_simulated=False)


def actuated(rig: Rig) -> Rig:
    config = tautscope.axes(2, width_limit=1.0)
    return with_actuators(rig, config.replace(actuators={"matrix": np.eye(2).tolist()}))


@pytest.mark.parametrize("wrap", [paced, actuated, lambda rig: paced(actuated(rig))])
@pytest.mark.parametrize("is_able", [True, False])
def test_a_wrapped_rig_is_interrupted_and_disabled_as_the_rig_itself(
    monkeypatch: pytest.MonkeyPatch, wrap: Callable[[Rig], Rig], is_able: bool
) -> None:
    class Able(Interrupted, Disabled): ...

    monkeypatch.setattr(Slow, "duration", 20.0 if is_able else 0.05)
    arm, closed = Able(2) if is_able else Slow(2), []
    monkeypatch.setattr(arm, "close", lambda: closed.append(True))
    rig = wrap(arm)
    with pytest.raises(StateError, match="interrupted" if is_able else "Enable it again"):
        reset_unless(rig, lambda: True)
    disable(rig)
    assert arm.is_interrupted == getattr(arm, "is_disabled", False) == is_able
    assert bool(closed) != is_able


@pytest.mark.parametrize("is_running", [False, True])
def test_a_log_that_cannot_be_written_leaves_the_motors_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_running: bool
) -> None:
    arm, closed = Arm(2), []
    monkeypatch.setattr(arm, "close", lambda: closed.append(True))
    (tmp_path / "file").touch()
    with control_of(tmp_path, arm) as control:
        if is_running:
            control.open()
        control.folder = tmp_path / "file"
        if is_running:
            control.restart(control.config)
        else:
            control.open()
        assert control.run is None
        assert closed
        state = session_state(control, LogState(), time.monotonic())
        assert state.motion == "off"
        assert f"log: got '{tmp_path / 'file'}" in state.message


def test_a_still_that_is_not_written_is_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    image = np.zeros((4, 4, 3), np.uint8)
    with control_of(tmp_path / "missing", Arm(2)) as control:
        control.lease.take(1)
        message = Action(control.lease.number, 1, 0, "still")
        Actions(control, lambda: image).execute(Received(1, time.monotonic(), message))
        deadline = time.monotonic() + 20
        while "still-1.png" not in caplog.text:
            assert time.monotonic() < deadline
            time.sleep(0.01)


class Unconfirmed(Arm):
    """Its drives do not confirm a stop: `close` says so, or a note of the error of `step`."""

    close_error = step_error = None

    def step(self, command: ArrayLike) -> Sample:
        if self.step_error is not None:
            raise self.step_error
        return super().step(command)

    def close(self) -> None:
        if self.close_error is not None:
            raise self.close_error


@pytest.mark.parametrize("where", ["close", "step"])
def test_a_stop_that_the_drives_do_not_confirm_is_not_shown_as_one(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, where: str
) -> None:
    arm = Unconfirmed(2)
    note = "bend_x: quick stop is not confirmed. Use the emergency stop: the motor may be moving"
    with control_of(tmp_path, arm) as control:
        session = session_of(control)

        def shown() -> tuple[str, str, str]:
            state = session_state(control, LogState(), time.monotonic())
            return state.motion, state.message, state.drives

        control.open()
        assert shown()[2] == "enabled"
        if where == "close":
            arm.close_error = StateError(*re.split(r"[:.] ", note, maxsplit=2))
            control.stop("STOP by page 1")
        else:
            arm.step_error = StateError("bend_y", "fault 12", "See the manual")
            arm.step_error.add_note(note)
            session._tick(control.run)
        assert control.run is None
        motion, message, drives = shown()
        assert motion == "unconfirmed"
        assert message.startswith("THE MOTORS MAY STILL MOVE: ")
        assert note in message
        assert drives == "THE MOTORS MAY STILL MOVE"
        with pytest.raises(StateError, match="emergency stop") as raised:
            control.shut_down()
        assert note in str(raised.value)
        assert raised.value.exit_status == STOPPED
        assert note in caplog.text
        arm.close_error = arm.step_error = None
        control.operator.enable()
        control.open()
        assert shown()[::2] == ("ready", "enabled")
        session._publisher.close()


def test_an_end_while_motors_are_enabled_tells_that_they_may_move(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arm = Unconfirmed(2)

    def reset() -> Sample:
        raise KeyboardInterrupt

    monkeypatch.setattr(arm, "reset", reset)
    arm.close_error = StateError("bend_x", "quick stop is not confirmed", "See to the rig")
    with control_of(tmp_path, arm) as control:
        with pytest.raises(KeyboardInterrupt):
            control.open()
        with pytest.raises(StateError, match=r"may still move .bend_x: quick") as raised:
            control.shut_down()
        assert raised.value.exit_status == STOPPED
        control.unconfirmed = ""


@pytest.mark.parametrize("is_simulated", [True, False])
def test_neither_a_hold_nor_a_warning_ends_with_its_run(tmp_path: Path, is_simulated: bool) -> None:
    with control_of(tmp_path, Arm(2), is_simulated=is_simulated) as control:
        session, actions = session_of(control), Actions(control, lambda: None)

        def shown() -> tuple[str, list[str]]:
            state = session_state(control, LogState(), time.monotonic())
            return state.motion, [name for name, _ in state.latched]

        def execute(number: int, **fields: str) -> Reply | None:
            kind = SetProfile if "profile" in fields else Action
            message = kind(control.lease.number, number, 0, **fields)
            return actions.execute(Received(1, time.monotonic(), message))

        control.lease.take(1)
        control.open()
        session._tick(control.run)
        control.run.loop.raise_flag("reference_jump")
        session._tick(control.run)
        reply = execute(1, profile="paper")
        assert (reply.is_accepted, reply.reason) == (False, "motion is held, press Enable first")
        assert shown() == ("held", ["reference_jump"])
        execute(2, name="enable")
        session._tick(control.run)
        if is_simulated:
            assert execute(3, profile="paper").is_accepted
            assert shown() == ("ready", ["reference_jump"])
        else:
            control.run.loop.raise_flag("drive_fault")
            session._tick(control.run)
            assert shown() == ("off", ["drive_fault", "reference_jump"])
        assert execute(4, name="acknowledge").is_accepted
        assert shown()[1] == []
        session._publisher.close()


@pytest.mark.parametrize("by", ["STOP", "profile"])
def test_a_take_ends_with_its_log(tmp_path: Path, by: str) -> None:
    paths = [tmp_path / f"console-{number}.mcap" for number in (1, 2)]
    with control_of(tmp_path, Arm(2)) as control:
        actions = Actions(control, lambda: None)
        control.lease.take(1)
        control.open()

        def record(number: int) -> str:
            message = Action(control.lease.number, number, 0, "record")
            return actions.execute(Received(1, time.monotonic(), message)).reason

        assert record(1) == f"take 1, lossless, into {paths[0]}"
        if by == "STOP":
            control.stop("STOP by page 1")
            control.operator.enable()
            control.open()
        else:
            control.restart(control.config.replace(profile="paper"))
        assert not control.is_recording
        assert control.run.log.image_format == "jpeg"
        assert record(2) == f"take 2, lossless, into {paths[1]}"
        assert record(3).startswith(f"take 2 is in {paths[1]}, from 0 to 0 s")
    for number, end in ((1, "the take ends with its log"), (2, "take 2 ends")):
        events = read_log(paths[number - 1]).events.values()
        notes = [event.text for event in events if isinstance(event, Request)]
        takes = [note for note in notes if "take" in note]
        assert takes == [f"note take {number} begins", f"note {end}"]


def test_nothing_is_known_of_a_rig_that_is_off_but_its_last_log(tmp_path: Path) -> None:
    with control_of(tmp_path, Arm(2)) as control:
        session = session_of(control)

        def shown() -> State:
            return session_state(control, session._publisher.log, time.monotonic())

        assert shown().tip == (None, None)
        assert shown().log == LogState()
        control.open()
        session._tick(control.run)
        assert shown().tip == (0.0, 0.0)
        path = str(control.run.path)
        deadline = time.monotonic() + 20
        while shown().log.path != path:
            assert time.monotonic() < deadline
            time.sleep(0.01)
        control.run.log._journal.failure = "the disk is full"
        control.stop("STOP by page 1")
        assert control.run is None
        assert shown().tip == (None, None)
        assert (shown().log.path, shown().log.failure) == (path, "the disk is full")
        ended = session_state(control, LogState(path, 5, remaining=9.0), time.monotonic()).log
        assert ended.remaining is None
        session._publisher.close()


@pytest.mark.parametrize("config", [Config(), tautscope.axes(1, width_limit=1.0)])
def test_what_is_slow_at_first_is_done_before_motors_are_enabled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, config: Config
) -> None:
    monkeypatch.setattr(vision, "_tables", {})
    rig = PacedRig(lambda: Arm(1), 0.005, is_simulated=False)
    with ThreadPoolExecutor(1) as executor:
        RigControl(config, rig, tmp_path, executor)
    assert bool(vision._tables) == (not config.dof)


def broken(*_: object) -> Sample:
    raise OSError("cable pulled")


def bend(page: Page, sign: int, is_done: Callable[[], bool]) -> None:
    """Bend the first plane until a condition holds, then let go."""
    deflection = (float(sign), 0.0)

    def hold() -> bool:
        page.servo(deflection, is_holding=not page.state["must_release"])
        return is_done()

    page.wait(hold, 0.02)
    page.servo((0.0, 0.0), is_holding=False)
    page.wait(lambda: page.state["motion"] == "ready")


@pytest.fixture(scope="module")
def colonoscope(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    folder = tmp_path_factory.mktemp("colonoscope")
    make: Callable[[Config], Rig] = lambda _: ColonoscopeTwin()  # noqa: E731
    with console_of(folder, load_config("colonoscope"), make, is_twin=True) as console:
        yield console


def test_each_degree_of_freedom_of_the_colonoscope_moves_alone(colonoscope: RunningConsole) -> None:
    page = colonoscope.page()
    assert [dof["name"] for dof in page.layout["dofs"]] == ["bend_x", "bend_y", "insertion"]
    assert [dof["unit"] for dof in page.layout["dofs"]] == ["rad", "rad", "mm"]
    assert page.layout["dofs"][2]["range"] == [-0.05, 0.05]
    page.take()
    for index in range(3):
        before = np.array(page.state["reference"])
        page.move(tuple(float(k == index) for k in range(3)))
        page.servo((0.0, 0.0, 0.0), is_holding=False)
        page.wait(lambda: page.state["motion"] == "ready")
        moved = np.array(page.state["reference"]) - before
        assert list(np.flatnonzero(moved)) == [index]
    assert rests(colonoscope)
    page.close()


def test_what_is_the_articles_is_refused(colonoscope: RunningConsole) -> None:
    page = colonoscope.page()
    page.take()
    assert page.layout["programs"] == ["home"]
    page.let_go()
    for name in ("sweep", "experiment"):
        reply = page.request(type="action", name=name)
        assert reply["reason"] == "only the article's instrument has this program"
    reply = page.request(type="setting", name="clutch", value=0, dof="rotation")
    assert reply["reason"] == "no degree of freedom 'rotation'"
    refused = colonoscope.control.operator.refused
    page.servo((1.0, 0.0))
    page.wait(lambda: refused["not one deflection per degree of freedom"] > 0)
    assert rests(colonoscope, 0.1)
    page.close()


def test_any_range_can_be_steered_and_is_not_left() -> None:
    wide, narrow = (-2.0, 3.0), (0.0, 0.2)
    dofs = [DofEntry(name=f"a{k}", width_limit=1.0, range=r) for k, r in enumerate((wide, narrow))]
    images = ImageTimes()
    lease = Lease(images)
    operator = OperatorInput(Config(dof=tuple(dofs)), lease)
    operator.scale[:] = 1
    lease.take(1)
    now, sequence = 0.0, 0
    for sign, ends in ((1, (2.75, 0.15)), (-1, (-1.75, 0.05))):
        for is_holding in (False, *[True] * 1000):
            now, sequence = now + 0.005, sequence + 1
            servo = Servo(
                lease.number, sequence, images.add(now), (sign * is_holding,) * 2, is_holding
            )
            operator.receive(Received(1, now, servo), now)
            operator.update(now, 0.005, operator.reference, is_held=False)
        # A quarter of the width within the range, or of a range that is narrower.
        assert np.allclose(operator.reference, ends, atol=2 * 0.75 * 0.005)


def test_a_rig_that_does_not_wait_is_paced_and_one_that_is_late_does_not_catch_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    clock = SimpleNamespace(now=100.0, monotonic=lambda: clock.now)
    clock.sleep = lambda pause: setattr(clock, "now", clock.now + pause)
    monkeypatch.setattr(paced_rig, "time", clock)
    arm = Arm(1)
    rig = PacedRig(lambda: arm, arm.control_period, is_simulated=True)
    rig.reset()
    for _ in range(10):
        rig.step([0.0])
    assert clock.now == pytest.approx(100.0 + 10 * 0.005)
    clock.now += 0.063
    rig.step([0.0])
    before = clock.now
    for _ in range(10):
        rig.step([0.0])
    assert 0.045 <= clock.now - before <= 0.05
