"""The node: states, the bits of its commands, and what it publishes."""

from pathlib import Path

import numpy as np
import pytest
from driving import START, commands, drive
from ros2.lockstep import compare
from ros2.peers import JOINTS, Peers
from tautscope.config import load_config
from tautscope.log.reader import read_log
from tautscope.log.replay import replay_same
from tautscope.loop.rig import Frame
from tautscope.ros2 import messages
from tautscope.ros2.lifecycle import State
from tautscope.ros2.wire import Qos

CONFIG = load_config()


@pytest.mark.parametrize("profile", ["best", "paper"])
def test_commands_have_the_bits_of_the_python_loop(tmp_path: Path, profile: str) -> None:
    config = load_config(None, profile)
    found = compare(config, tmp_path, 2.0, seed=3, shares=[(1.0, 0.5), (1.5, 1.0)])
    assert found.ticks == 400
    assert found.different == 0
    assert found.updates >= found.images - 1 >= 45
    assert found.missed == 0
    assert found.travel.min() > 0.01
    same, _ = replay_same(read_log(found.log))
    assert same.is_identical
    assert same.ticks == 400


def test_pause_and_disable_stop_motion(both: Peers) -> None:
    both.enable(START)
    last = drive(both, 50, 0.01)
    both.request("pause")
    assert both.control.operating_state == "PAUSED"
    drive(both, 1, 0.01, at=last)
    commands(both)
    drive(both, 20, 0.01, at=last)
    assert np.ptp(commands(both), axis=0).max() == 0
    both.request("disable")
    assert both.control.operating_state == "DISABLED"
    assert both.control.lifecycle.state is State.INACTIVE
    assert [each.state for each in both.drain(both.states)][-1] == "DISABLED"


def test_a_driver_that_is_silent_is_a_fault(both: Peers) -> None:
    both.enable(START)
    drive(both, 10)
    both.clock.before_tick = lambda: None
    for _ in range(25):
        if both.control.run is not None:
            both.tick()
    assert both.control.operating_state == "FAULT"
    assert "/instrument/actuators/measured_js" in both.control.fault
    commands(both)
    both.control.serve()
    assert not len(commands(both))  # no set-point, by which the driver stops


def test_a_missing_driver_is_named(both: Peers) -> None:
    both.request("enable")
    assert both.control.run is None
    assert both.control.operating_state == "FAULT"
    assert "Start the driver" in both.control.fault


def test_a_position_from_before_does_not_start_motion(both: Peers) -> None:
    both.send_position(START)
    both.delivered()
    both.request("enable")
    assert both.control.run is None
    assert "Start the driver" in both.control.fault


def test_enable_changes_nothing_while_enabled(both: Peers) -> None:
    both.enable(START)
    run = both.control.run
    drive(both, 5)
    both.request("enable")
    assert both.control.run is run
    assert both.control.lifecycle.state is State.ACTIVE


def test_unknown_commands_are_refused(both: Peers) -> None:
    both.request("home")
    warning = both.received(both.warnings, "warning")
    assert "/instrument/state_command string: got 'home'" in warning.data


def test_the_tip_has_stamp_0_while_markers_are_lost(both: Peers) -> None:
    tips = both.other.subscription("/instrument/measured_js", JOINTS, Qos(depth=100))
    offsets = both.other.subscription(
        "/instrument/hysteresis/delta", "std_msgs/msg/Float64MultiArray"
    )
    both.delivered(resend=True)
    both.enable(START)
    camera = CONFIG.camera
    rng = np.random.default_rng(1)

    def send() -> None:
        both.send_position(START)
        both.send_reference(START)
        pixels = rng.integers(40, 60, (camera.height, camera.width, 3), np.uint8)
        image = messages.image(both.clock.wall(), Frame(pixels, 0.0, 1), camera)
        both.images.publish(image)
        both.delivered()

    both.clock.before_tick = send
    for _ in range(6):
        both.tick()
    found = both.drain(tips)
    assert len(found) >= 3
    assert all((tip.header.stamp.sec, tip.header.stamp.nanosec) == (0, 0) for tip in found)
    assert all(tip.name == ["insertion", "rotation", "bending"] for tip in found)
    (delta,) = both.drain(offsets)
    assert [each.size for each in delta.layout.dim] == [3, 2]


def test_the_state_is_published_as_diagnostics(both: Peers) -> None:
    diagnostics = both.other.subscription("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    both.delivered(resend=True)
    both.clock.now += 2 * 10**9
    both.control.serve()
    (status,) = both.received(diagnostics, "diagnostics").status
    assert (status.name, status.message) == ("tautscope", "DISABLED")
