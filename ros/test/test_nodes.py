"""The two lifecycle nodes: what an operator, an endoscope and the drives see of them."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest
from ament_index_python.packages import get_package_prefix
from conftest import JOINTS, Laboratory, last_motion, stamp
from crtk_msgs.msg import OperatingState
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters

PACKAGES = ("tautscope_node", "tautscope_control")


@pytest.fixture(params=PACKAGES)
def laboratory(request, ros, processes, recorded):
    package = request.param
    executable = Path(get_package_prefix(package)) / "lib" / package / "instrument_node"
    arguments = ["--ros-args", "-r", "__ns:=/instrument", "-p", f"config:={recorded.config}"]
    processes.append(subprocess.Popen([executable, *arguments]))
    laboratory = Laboratory("/instrument", "/instrument/actuators/setpoint_js")
    change(laboratory, Transition.TRANSITION_CONFIGURE)
    change(laboratory, Transition.TRANSITION_ACTIVATE)
    laboratory.wait_for(lambda: laboratory.states[-1:] == ["DISABLED"])
    yield laboratory
    laboratory.destroy_node()


def call(laboratory, kind, name, request):
    client = laboratory.create_client(kind, name)
    assert client.wait_for_service(20.0)
    future = client.call_async(request)
    laboratory.executor_of_tests.spin_until_future_complete(future, 20.0)
    return future.result()


def change(laboratory, transition):
    request = ChangeState.Request(transition=Transition(id=transition))
    assert call(laboratory, ChangeState, "/instrument/tautscope/change_state", request).success


def test_a_session(laboratory, recorded):
    # Without `enable` nothing is sent.
    laboratory.wait_for(lambda: laboratory.references.get_subscription_count() > 0)
    for _ in range(50):
        laboratory.refer(recorded.ticks[0][2:5])
        laboratory.spin(0.005)
    assert laboratory.commands == []

    # The recording, with its images.
    laboratory.measure(recorded.ticks[0][2:5])
    laboratory.request("enable")
    laboratory.wait_for(lambda: laboratory.states[-1] == "ENABLED")
    last, shown = laboratory.replay(recorded)
    laboratory.spin(1.0)
    commands = list(laboratory.commands)
    assert len(commands) > 0.8 * len(recorded.ticks)
    assert all(list(each.name) == JOINTS and each.header.frame_id == "guide" for each in commands)
    assert (np.diff([stamp(each) for each in commands]) > 0).all()
    # Images are measured, with the time of their capture.
    stamps = [stamp(each) for each in laboratory.measured]
    measured = [each for each in stamps if each != 0]
    assert len(measured) > 0.5 * len(shown)
    assert all(np.abs(np.array(shown) - each).min() < 1000 for each in measured)
    # Then there are no images any more.
    assert stamps[-1] == 0

    # The device is silent: the motion has stopped, and set-points go on.
    assert last_motion(commands) <= last + 100_000_000
    assert stamp(commands[-1]) > last + 500_000_000
    assert laboratory.states[-1] == "PAUSED"
    assert any("reference_late" in text for text in laboratory.warnings)

    # Resumed elsewhere: no jump.
    before = np.array(laboratory.commands[-1].position)
    laboratory.request("resume")
    elsewhere = recorded.ticks[-1][2:5] + np.array([10e-3, 0.5, -0.2])
    for number in range(200):
        laboratory.refer(elsewhere + np.array([1e-5 * number, 0, 0]))
        laboratory.spin(0.005)
    laboratory.wait_for(lambda: laboratory.states[-1] == "ENABLED")
    steps = np.diff([before, *(each.position for each in laboratory.commands[-150:])], axis=0)
    largest = np.abs(steps).max(axis=0)
    assert largest[0] > 0
    assert (largest < [2e-3, 0.1, 0.05]).all()

    # A fault of the drives: they get a command to stop, and no set-point.
    assert laboratory.drive_commands == []
    laboratory.drive_states.publish(OperatingState(state="FAULT"))
    laboratory.wait_for(lambda: laboratory.states[-1] == "FAULT")
    laboratory.wait_for(lambda: laboratory.drive_commands[:1] == ["pause"])
    sent = len(laboratory.commands)
    laboratory.spin(0.2)
    assert len(laboratory.commands) == sent
    laboratory.request("enable")
    laboratory.wait_for(lambda: laboratory.states[-1] == "ENABLED")

    # Deactivated: the same.
    laboratory.drive_commands.clear()
    change(laboratory, Transition.TRANSITION_DEACTIVATE)
    laboratory.wait_for(lambda: "pause" in laboratory.drive_commands)
    laboratory.wait_for(lambda: laboratory.states[-1] == "DISABLED")
    change(laboratory, Transition.TRANSITION_CLEANUP)
    change(laboratory, Transition.TRANSITION_CONFIGURE)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_end_of_the_process_stops_the_drives(laboratory, processes, recorded, number):
    laboratory.measure(recorded.ticks[0][2:5])
    laboratory.request("enable")
    laboratory.wait_for(lambda: laboratory.states[-1] == "ENABLED")
    for _ in range(20):
        laboratory.refer(recorded.ticks[0][2:5])
        laboratory.spin(0.005)
    laboratory.wait_for(lambda: bool(laboratory.commands))
    assert laboratory.drive_commands == []
    processes[0].send_signal(number)
    laboratory.wait_for(lambda: laboratory.drive_commands == ["pause"])
    assert processes[0].wait(10) == 0


def test_enable_is_refused_while_it_is_not_known_where_the_drives_are(laboratory):
    laboratory.request("enable")
    laboratory.wait_for(lambda: any("enable is refused" in text for text in laboratory.warnings))
    assert laboratory.states[-1] == "DISABLED"


def test_silent_drives_are_a_fault(laboratory, recorded):
    laboratory.measure(recorded.ticks[0][2:5])
    laboratory.request("enable")
    laboratory.wait_for(lambda: laboratory.states[-1] == "ENABLED")
    laboratory.position.clear()
    laboratory.spin(0.5)
    assert laboratory.states[-1] == "FAULT"


def test_motion_begins_where_the_drives_are(laboratory, recorded):
    reference = recorded.ticks[0][2:5]
    position = reference + np.array([5e-3, 0.2, 0.1])
    laboratory.measure(position)
    laboratory.request("enable")
    laboratory.wait_for(lambda: bool(laboratory.commands))
    assert list(laboratory.commands[-1].position) == position.tolist()


def test_the_share_of_the_compensation_is_checked(laboratory):
    def set_share(share):
        value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=share)
        request = SetParameters.Request(parameters=[Parameter(name="compensation", value=value)])
        return call(
            laboratory, SetParameters, "/instrument/tautscope/set_parameters", request
        ).results[0]

    assert set_share(0.5).successful
    refused = set_share(1.5)
    assert not refused.successful
    assert "compensation" in refused.reason
