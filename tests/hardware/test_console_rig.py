"""Drives under the console: enabling needs the page's presence, STOP is a quick stop."""

import multiprocessing
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from fake_rig import Setup
from tautscope.console.messages import Action, Received, Servo, Stop, encode
from tautscope.console.rig_control import INTERRUPTED, RigControl
from tautscope.console.session import Session
from tautscope.console.shared import Channels, SharedMemory
from tautscope.dof import Dof

NOTHING: Callable[[], None] = lambda: None  # noqa: E731


class Desk:
    """A rig under the console, with a page that is present when it is told to be."""

    def __init__(self, folder: Path, executor: ThreadPoolExecutor) -> None:
        self.setup = Setup(drives={"start_speed": 0.05})
        self.control = RigControl(self.setup.config, self.setup.rig, folder, executor)
        self.control.lease.take(1)
        self._sequence = 0

    def be_present(self) -> None:
        self._sequence += 1
        servo = Servo(self.control.lease.number, self._sequence, 0, (0.0, 0.0, 0.0), False)
        now = time.monotonic()
        self.control.operator.receive(Received(1, now, servo), now)

    def open(self, meanwhile: Callable[[], None], patience: float = 60.0) -> None:
        """Enable the rig while the page does something; a busy computer may take its time."""
        self.control.while_opening = meanwhile
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("tautscope.console.operator_input.IDLE_TIMEOUT", patience)
            self.be_present()
            self.control.open()


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    with ThreadPoolExecutor(1) as executor:
        found = Desk(tmp_path, executor)
        yield found
        found.control.shut_down()


def test_a_present_page_enables_and_a_stop_is_a_quick_stop(desk: Desk, tmp_path: Path) -> None:
    desk.open(desk.be_present)
    run = desk.control.run
    assert run is not None, desk.control.fault
    start = [desk.setup.config.experiment[dof].centre for dof in Dof]
    assert np.allclose(desk.setup.motors.commands[-1], start)
    for _ in range(3):
        run.tick()
        run.step()
    assert desk.setup.motors.stopped == 0
    desk.control.stop("STOP by page 3")
    assert desk.setup.motors.stopped == 1
    assert desk.control.run is None
    assert desk.control.fault == "STOP by page 3"
    desk.control.shut_down()
    assert (tmp_path / "console-1.mcap").stat().st_size > 0


def test_a_page_that_goes_away_interrupts_the_move_to_the_start(desk: Desk) -> None:
    desk.open(NOTHING, patience=0.0)
    assert desk.control.run is None
    assert desk.control.fault == INTERRUPTED
    assert desk.setup.motors.stopped == 1
    start = [desk.setup.config.experiment[dof].centre for dof in Dof]
    assert not np.allclose(desk.setup.motors.commands[-1:] or [[9, 9, 9]], start)


def test_a_stop_interrupts_the_move_to_the_start(desk: Desk) -> None:
    desk.open(lambda: desk.control.stop("STOP"))
    assert desk.control.run is None
    assert desk.control.fault == INTERRUPTED
    assert desk.control.operator.stopped_by == "STOP"
    assert desk.setup.motors.stopped == 1


def test_a_quick_stop_by_the_supervisor_needs_a_new_start(desk: Desk) -> None:
    desk.open(desk.be_present)
    run = desk.control.run
    assert run is not None, desk.control.fault
    run.tick()
    run.loop.raise_flag("drive_fault")
    assert run.is_held
    desk.control.close("quick_stop: drive_fault")
    assert desk.setup.motors.stopped == 1
    desk.open(desk.be_present)
    assert desk.control.run is not None
    assert desk.control.run is not run


@pytest.mark.parametrize("is_opening", [False, True], ids=["link", "double click"])
def test_an_enable_that_waited_does_not_undo_a_stop(
    desk: Desk, monkeypatch: pytest.MonkeyPatch, is_opening: bool
) -> None:
    memory = SharedMemory(multiprocessing.get_context("spawn"), desk.setup.config)
    page, session = Channels(memory), Session(desk.control, Channels(memory))
    monkeypatch.setattr(desk.control.operator, "is_present", lambda now: True)
    sent = []

    def stop() -> None:
        if not sent:
            sent.append(len(desk.setup.motors.commands))
            page.stop.write(encode(Received(2, time.monotonic(), Stop())))

    def enable(number: int) -> None:
        action = Action(desk.control.lease.number, number, 0, "enable")
        page.inbound.write(encode(Received(1, time.monotonic(), action)))

    receive = desk.control.while_opening
    desk.control.while_opening = lambda: (desk.setup.motors.commands and stop(), receive())
    enable(1)
    if is_opening:
        enable(2)  # a double click; STOP follows while the motors move to the start
    else:
        stop()  # both arrive together
    time.sleep(0.001)
    session._receive()
    assert desk.control.run is None
    assert desk.control.operator.stopped_by == "STOP by page 2"
    assert len(desk.setup.motors.commands) <= sent[0] + 20 * is_opening
    assert desk.setup.motors.stopped == is_opening
    assert desk.control.operator.refused["motion was stopped after it, press Enable again"] == 1
    time.sleep(0.001)
    enable(3)
    session._receive()
    assert desk.control.run is not None, desk.control.fault
    session._publisher.close()
