"""Operating states of the rclpy node's loop, and the same commands as the loop alone."""

from concurrent.futures import Executor, Future, ThreadPoolExecutor

import numpy as np
import pytest
import record
from tautscope import Config, Frame
from tautscope.loop.operating_state import OperatingState
from tautscope.loop.reduction import Status
from tautscope.loop.safety import Reaction
from tautscope.ros2 import driver
from tautscope_node.control_loop import DRIVER_TIMEOUT, ControlLoop

START = np.array([25e-3, 0.0, 0.9])
PERIOD = Config().control.period


class Refused(Executor):
    """An executor that must not be used."""

    def submit(self, *_):
        raise AssertionError


def enabled(executor, config=None):
    """A loop whose drives are at START, which it enables."""
    control = ControlLoop(config or Config(), executor)
    control.set_measured(START, 0.0)
    control.request("enable", 0.0)
    return control


class Rig:
    """A loop with its clock, and an operator who moves the insertion."""

    def __init__(self):
        self.control = ControlLoop(Config(), Refused())
        self.drives, self.are_silent = START, False
        self.reference = START.copy()
        self.time = 100.0
        self.commands = []

    def request(self, command):
        self.measure()
        return self.control.request(command, self.time)

    def measure(self):
        if not self.are_silent:
            self.control.set_measured(self.drives, self.time)

    def wait(self, duration):
        """Ticks without a word from the operator."""
        for _ in range(max(1, round(duration / PERIOD))):
            self.measure()
            tick = self.control.step(self.time)
            self.drives = tick.command if tick.is_sent else self.drives
            self.control.exchange(None)
            self.commands.append((self.time, tick.command[0]))
            self.time += PERIOD
        return tick

    def move(self, duration, speed=10e-3):
        """Ticks with a new reference each."""
        for _ in range(round(duration / PERIOD)):
            self.reference[0] += speed * PERIOD
            self.control.set_reference(self.reference, self.time)
            tick = self.wait(0)
        return tick

    def motion(self, since):
        """Times of ticks in which the command moved, and the largest step."""
        recent = [row for row in self.commands if row[0] >= since - 1.5 * PERIOD]
        steps = np.abs(np.diff([value for _, value in recent]))
        times = [time for (time, _), step in zip(recent[1:], steps, strict=True) if step > 0]
        return times, steps.max(initial=0)


def test_nothing_is_sent_before_it_is_enabled():
    rig = Rig()
    tick = rig.move(0.1)
    assert (tick.is_sent, tick.state) == (False, OperatingState.DISABLED)
    assert rig.request("enable")
    tick = rig.wait(0.1)
    assert tick.is_sent
    assert (tick.command == START).all()
    tick = rig.move(0.1)
    assert tick.is_sent
    assert tick.command[0] > START[0]
    assert rig.request("disable")
    assert not rig.move(0.1).is_sent


@pytest.mark.parametrize("after", [0.5, 0.505, 1.7])
def test_a_silent_device_stops_the_motion_within_100_ms(after):
    rig = Rig()
    rig.request("enable")
    rig.move(after)
    silent_since = rig.time
    tick = rig.wait(1.0)
    times, _ = rig.motion(0.0)
    assert silent_since - 2 * PERIOD < times[-1] <= silent_since + 0.1
    assert (tick.is_sent, tick.state) == (True, OperatingState.PAUSED)
    assert "reference_late" in rig.control.supervision.flags
    # The device returns elsewhere: nothing moves before the operator resumes, and then from there.
    rig.reference[0] += 20e-3
    returned = rig.time
    assert rig.move(0.5).state is OperatingState.PAUSED
    assert rig.motion(returned)[0] == []
    rig.request("resume")
    assert rig.move(0.5).state is OperatingState.ENABLED
    times, largest = rig.motion(returned)
    assert times
    assert largest < 1e-3


def test_a_jump_stops_the_motion():
    rig = Rig()
    rig.request("enable")
    rig.move(0.5)
    rig.reference[0] += 20e-3
    assert rig.move(0.2).state is OperatingState.PAUSED
    assert rig.motion(0.0)[1] < 1e-3


def test_a_pause_holds_until_resumed():
    rig = Rig()
    rig.request("enable")
    rig.move(0.5)
    rig.request("pause")
    rig.wait(PERIOD)
    paused = rig.time
    tick = rig.move(2.0)
    assert (tick.is_sent, tick.state) == (True, OperatingState.PAUSED)
    assert rig.motion(paused)[0] == []
    rig.request("resume")
    assert rig.move(1.0).state is OperatingState.ENABLED
    times, largest = rig.motion(paused)
    assert times
    assert largest < 1e-3


def test_a_drive_fault_stops_the_drives_until_enabled():
    rig = Rig()
    rig.control.raise_drive_fault()
    assert rig.control.state is OperatingState.DISABLED
    rig.request("enable")
    rig.move(0.5)
    rig.control.raise_drive_fault()
    tick = rig.move(0.1)
    assert (tick.is_sent, tick.state) == (False, OperatingState.FAULT)
    rig.request("resume")
    tick = rig.wait(PERIOD)
    assert tick.state is OperatingState.FAULT
    rig.request("enable")
    tick = rig.move(0.5)
    assert (tick.is_sent, tick.state) == (True, OperatingState.ENABLED)


def test_a_repeated_drive_fault_can_be_cleared():
    rig = Rig()
    rig.request("enable")
    # The operator enables too early, and again when it is cleared.
    for _ in range(2):
        for _ in range(100):
            rig.control.raise_drive_fault()
            tick = rig.move(0.1)
        assert (tick.is_sent, tick.state) == (False, OperatingState.FAULT)
        assert rig.control.supervision.reaction is Reaction.QUICK_STOP
        rig.request("enable")
    tick = rig.move(0.5)
    assert (tick.is_sent, tick.state) == (True, OperatingState.ENABLED)


@pytest.mark.parametrize("command", ["enable", "pause"])
def test_silent_drives_are_a_drive_fault(command):
    rig = Rig()
    rig.request("enable")
    rig.move(0.5)
    rig.request(command)
    silent_since = rig.time
    rig.are_silent = True
    assert rig.move(0.1 - PERIOD).is_sent
    rig.move(2 * PERIOD)
    tick = rig.wait(PERIOD)
    assert (tick.is_sent, tick.state) == (False, OperatingState.FAULT)
    assert "drive_fault" in rig.control.supervision.flags
    assert rig.time < silent_since + 0.1 + 4 * PERIOD
    # However long it lasts: enabled when they are back, not before.
    rig.move(10.0)
    rig.request("enable")
    assert rig.move(0.1).state is OperatingState.DISABLED
    assert rig.control.is_unmeasured
    rig.are_silent = False
    rig.request("enable")
    assert rig.move(0.1).state is OperatingState.ENABLED


@pytest.mark.parametrize("age", [0.11, 3600.0, -3600.0])
def test_a_position_of_long_ago_is_none(age):
    control = ControlLoop(Config(), Refused())
    control.set_measured(START, 100.0)
    control.request("enable", 100.0 + age)
    assert not control.step(100.0 + age).is_sent
    assert control.is_unmeasured


def test_the_drives_may_be_silent_as_long_as_those_of_a_driver():
    assert DRIVER_TIMEOUT == driver.DRIVER_TIMEOUT


def test_motion_begins_where_the_drives_are():
    rig = Rig()
    measured = np.array([35e-3, 0.1, 0.8])
    rig.drives = measured
    rig.control.set_measured([np.nan] * 3, rig.time)
    rig.request("enable")
    assert (rig.wait(0.1).command == measured).all()
    tick = rig.move(0.5)
    assert measured[0] < tick.command[0] < measured[0] + 15e-3
    assert rig.motion(0.0)[1] < 1e-3
    rig.request("disable")
    rig.wait(1.0)
    rig.request("enable")
    assert rig.wait(PERIOD).state is OperatingState.ENABLED
    rig.request("disable")
    rig.drives = tick.command + np.array([2e-3, 0.0, 0.0])
    rig.request("enable")
    tick = rig.move(0.1)
    assert (tick.is_sent, tick.state) == (False, OperatingState.FAULT)
    assert rig.control.is_misplaced


@pytest.mark.parametrize("has_times", [False, True], ids=["chained", "simulated time"])
@pytest.mark.parametrize("requests", [["enable"], ["enable", "pause", "resume"]])
def test_the_first_reference_is_where_the_operator_is(has_times, requests):
    rig = Rig()
    for request in requests:
        rig.request(request)
    rig.reference = START + np.array([20e-3, 1.5, -0.7])
    for _ in range(20):
        # A reference of each tick, made in it.
        rig.control.set_reference(rig.reference, rig.time if has_times else None)
        tick = rig.wait(0)
        assert tick.is_sent
        assert (tick.command == START).all()
    rig.move(0.5)
    assert rig.motion(0.0)[0]
    assert rig.motion(0.0)[1] < 1e-3


def test_enable_is_refused_while_it_is_not_known_where_the_drives_are():
    rig = Rig()
    rig.drives = np.array([np.nan, 0.0, 0.9])
    assert rig.request("enable")
    tick = rig.move(0.1)
    assert (tick.is_sent, tick.state) == (False, OperatingState.DISABLED)
    assert rig.control.is_unmeasured
    rig.drives = START
    rig.request("enable")
    assert rig.wait(0.1).is_sent
    assert not rig.control.is_unmeasured


def test_a_reference_from_before_neither_begins_nor_stops_a_motion():
    rig = Rig()
    rig.request("enable")
    rig.control.set_reference(START, rig.time - 1.0)
    tick = rig.wait(0.5)
    assert (tick.is_sent, tick.state) == (True, OperatingState.ENABLED)
    assert (tick.command == START).all()
    rig.move(0.5)
    rig.request("pause")
    rig.wait(0.5)
    rig.request("resume")
    rig.control.set_reference([40e-3, 0.0, 0.9], rig.time - 0.2)
    resumed = rig.time
    assert rig.wait(0.5).state is OperatingState.ENABLED
    assert rig.motion(resumed)[0] == []


def test_what_is_not_finite_or_not_known_changes_nothing():
    rig = Rig()
    rig.request("enable")
    rig.move(0.5)
    before = rig.wait(PERIOD)
    rig.control.set_reference([np.nan, 0.0, 0.9], rig.time)
    assert (rig.wait(PERIOD).command == before.command).all()
    assert not rig.request("home")
    assert rig.control.state is OperatingState.ENABLED


@pytest.mark.parametrize("profile", ["paper", "best"])
def test_the_commands_are_those_of_the_loop_alone(profile, monkeypatch):
    shorter = {"DURATION": 56.0, "PERIOD": 5e-3, "TICKS_PER_IMAGE": 8, "LATENCY": 16}
    for name, value in shorter.items():
        monkeypatch.setattr(record, name, value)
    recorded = record.record_features(profile)
    control = enabled(Refused(), recorded.config)
    images = iter(recorded.images)
    image = next(images)
    states, drives = set(), START
    for number, row in enumerate(recorded.ticks):
        time, made_at, *values = row
        control.set_measured(drives, time)
        reference, event, expected = values[:3], int(values[3]), values[4:]
        match event:
            case 1:
                is_fault = control.state is OperatingState.FAULT
                control.request("enable" if is_fault else "resume", time)
            case 2:
                control.request("acknowledge", time)
            case 3:
                control.raise_drive_fault()
            case 4 | 5:
                control.loop.set_compensation(0.5 if event == 4 else 1.0)
        control.set_reference(reference, None if np.isnan(made_at) else made_at)
        tick = control.step(time)
        states.add(tick.state)
        assert tick.command.tolist() == expected, f"tick {number}"
        drives = tick.command
        while image is not None and image[0] == number:
            features = image[2:6]
            control.loop.on_features(None if np.isnan(features).all() else features, image[1])
            image = next(images, None)
    assert states == {OperatingState.ENABLED, OperatingState.PAUSED, OperatingState.FAULT}


class Held(Executor):
    """An executor whose work is done when a test says so."""

    def __init__(self):
        self.waiting = []

    def submit(self, function):
        future = Future()
        self.waiting.append((future, function))
        return future

    def work(self):
        for future, function in self.waiting:
            future.set_result(function())
        self.waiting.clear()


def test_ticks_go_on_while_an_image_is_detected():
    executor = Held()
    control = enabled(executor)
    control.set_reference(START, 0.0)
    image = np.zeros((576, 720, 3), np.uint8)
    frames = [Frame(image, number * PERIOD, number) for number in range(4)]
    for frame in frames:
        control.set_reference(START, frame.captured_at)
        assert control.step(frame.captured_at).is_sent
        assert control.exchange(frame) == []
    # Of those that waited only the newest is detected.
    executor.work()
    (first,) = control.exchange(None)
    executor.work()
    (second,) = control.exchange(None)
    assert [used.sequence for used, _ in (first, second)] == [0, 3]
    assert first[1].status is Status.NO_MARKERS


def test_an_image_from_before_it_was_disabled_is_not_used():
    executor = Held()
    control = enabled(executor)
    control.set_reference(START, 0.0)
    control.step(0.0)
    control.exchange(Frame(np.zeros((576, 720, 3), np.uint8), 0.0, 1))
    control.request("disable", PERIOD)
    control.step(PERIOD)
    control.exchange(None)
    executor.work()
    control.set_measured(START, 3600.0)
    control.request("enable", 3600.0)
    control.step(3600.0)
    assert control.exchange(None) == []


def test_the_first_image_creates_nothing_in_a_tick(monkeypatch):
    control = enabled(Held())
    control.set_reference(START, 0.0)
    control.step(0.0)
    monkeypatch.setattr("tautscope.loop.vision.MarkerDetector", None)
    assert control.exchange(Frame(np.zeros((576, 720, 3), np.uint8), 0.0, 1)) == []


def test_images_go_through_a_thread():
    with ThreadPoolExecutor(1) as executor:
        control = enabled(executor)
        frame = Frame(np.zeros((576, 720, 3), np.uint8), 0.0, 1)
        control.set_reference(START, 0.0)
        control.step(0.0)
        reports = control.exchange(frame)
        while not reports:
            reports = control.exchange(None)
        assert reports[0][0] is frame
