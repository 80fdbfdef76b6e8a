"""The command, as processes: a driver stops when the node is killed; exits are clean."""

import json
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import zenoh
from common.paths import ROOT
from ros2.peers import JOINTS, free_endpoint
from tautscope.cli import main
from tautscope.log.reader import read_log
from tautscope.log.replay import replay_same
from tautscope.ros2 import messages
from tautscope.ros2.session import Node

PAGE = (ROOT / "docs" / "interfaces" / "ros2.md").read_text(encoding="utf-8")
NAMES = ["insertion", "rotation", "bending"]
START = np.array([0.025, 0.0, 0.9])
TIMEOUT = 60.0
PYTHON = [sys.executable, "-W", "error"]


@contextmanager
def process(*arguments: object) -> Iterator[subprocess.Popen[str]]:
    found = subprocess.Popen(
        [*PYTHON, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    )
    try:
        yield found
    finally:
        found.kill()
        found.communicate()


class Operator:
    """Requests and references of a test."""

    def __init__(self, endpoint: str) -> None:
        self.node = Node("operator", connect=endpoint)
        self._states = self.node.subscription(
            "/instrument/operating_state", "crtk_msgs/msg/OperatingState"
        )
        self._requests = self.node.publisher(
            "/instrument/state_command", "crtk_msgs/msg/StringStamped"
        )
        self._servo = self.node.publisher("/instrument/servo_jp", JOINTS)

    def request(self, text: str) -> None:
        self._requests.publish({"string": text})

    def enable(self) -> None:
        """Also where a late tick has paused the node since it was enabled."""
        self.wait("ENABLED", lambda: [self.request(each) for each in ("enable", "resume")])

    def wait(self, state: str, meanwhile: Callable[[], object] = lambda: None) -> None:
        begin = time.monotonic()
        while True:
            message = self._states.take()
            if message is not None and message.state == state:
                return
            assert time.monotonic() < begin + TIMEOUT, f"not {state}"
            meanwhile()
            time.sleep(0.02)

    def move(self, duration: float) -> None:
        begin = time.monotonic()
        while (elapsed := time.monotonic() - begin) < duration:
            wave = np.array([0.003, 0.3, 0.2]) * np.sin(2 * np.pi * elapsed / 4)
            self._servo.publish(messages.joint_state(time.time_ns(), NAMES, START + wave))
            time.sleep(0.005)


@contextmanager
def operator(endpoint: str) -> Iterator[Operator]:
    found = Operator(endpoint)
    try:
        yield found
    finally:
        found.node.close()


def node_command(folder: Path, endpoint: str, *options: str) -> list[object]:
    where = ["--listen", endpoint, "--out", folder / "out", "--json"]
    return ["-m", "tautscope", "ros2", *options, *where]


@pytest.fixture
def endpoint() -> str:
    return free_endpoint()


class Enabled(NamedTuple):
    """A node that moves a driver's motors, both as processes, and its operator."""

    node: subprocess.Popen[str]
    driver: subprocess.Popen[str]
    user: Operator


@pytest.fixture
def enabled(tmp_path: Path, endpoint: str) -> Iterator[Enabled]:
    with (
        process(*node_command(tmp_path, endpoint, "--driver")) as node,
        process("examples/ros2/driver.py", endpoint) as driver,
        operator(endpoint) as user,
    ):
        assert json.loads(line(node)) == {"node": "/tautscope"}
        user.enable()
        user.move(0.5)
        yield Enabled(node, driver, user)


@pytest.mark.parametrize(("end", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 0)])
def test_the_driver_stops_and_the_log_replays_after_a_signal(
    tmp_path: Path, enabled: Enabled, end: signal.Signals, status: int
) -> None:
    enabled.node.send_signal(end)
    assert enabled.node.wait(TIMEOUT) == status
    assert json.loads(line(enabled.driver))["event"] == "quick stop"
    assert enabled.node.stderr is not None
    assert "error" not in enabled.node.stderr.read().lower()
    same, _ = replay_same(read_log(tmp_path / "out" / "ros2-1.mcap"))
    assert same.is_identical


def test_the_driver_stops_when_the_node_is_killed(enabled: Enabled) -> None:
    enabled.node.kill()
    assert json.loads(line(enabled.driver))["event"] == "quick stop"


def test_a_device_that_ends_pauses_the_node(enabled: Enabled) -> None:
    enabled.user.wait("PAUSED")


def test_drives_of_a_configuration_stop_when_the_node_is_killed(
    tmp_path: Path, endpoint: str
) -> None:
    with subprocess.Popen(
        [*PYTHON, "-m", "tautscope", "bench"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as bench:
        assert json.loads(line(bench))["what"] == "ready"
        with (
            process(*node_command(tmp_path, endpoint, "--config", "bench")) as node,
            operator(endpoint) as user,
        ):
            line(node)
            user.enable()
            user.move(0.5)
            node.kill()
            found: list[str] = []
            while found.count("quick stop active") < 3:
                found.append(json.loads(line(bench))["what"])
        assert found.count("operation enabled") == 3
        assert bench.stdin is not None
        bench.stdin.close()


def test_nodes_meet_at_a_router(tmp_path: Path, endpoint: str) -> None:
    settings = zenoh.Config()
    settings.insert_json5("mode", '"router"')
    settings.insert_json5("listen/endpoints", json.dumps([endpoint]))
    settings.insert_json5("scouting/multicast/enabled", "false")
    where = ["--connect", endpoint, "--out", tmp_path / "out", "--json"]
    with (
        zenoh.open(settings),
        process("-m", "tautscope", "ros2", "--driver", *where) as node,
        process("examples/ros2/driver.py", endpoint),
        operator(endpoint) as user,
    ):
        line(node)
        user.enable()


def test_the_first_steps_of_the_page_work_as_written(tmp_path: Path, endpoint: str) -> None:
    block, device = re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL)[:2]
    node = shlex.split(block.strip().splitlines()[-1])
    assert node[:3] == ["uv", "run", "tautscope"]
    other = shlex.split(device.strip())
    assert other[:3] == ["uv", "run", "python"]
    # On another port, and with another folder for the log, so that tests may run side by side.
    assert node[-2:] == ["--listen", "tcp/127.0.0.1:7447"]
    options = [endpoint if each.startswith("tcp/") else each for each in node[3:]]
    with (
        process("-m", "tautscope", *options, "--out", tmp_path / "out") as started,
        process(*other[3:], endpoint, "3") as operator_process,
    ):
        assert "commands the twin" in line(started)
        shown, errors = operator_process.communicate(timeout=TIMEOUT)
        assert operator_process.returncode == 0, errors
        assert shown.startswith("tip at ")
        started.send_signal(signal.SIGINT)
        assert started.wait(TIMEOUT) == 0


def test_drives_need_a_configuration(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ros2"]) == 2
    assert "drives: got None" in capsys.readouterr().err


def test_the_network_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    command = ["ros2", "--driver", "--out", str(tmp_path / "out"), "--listen", "tcp/0.0.0.0:7447"]
    assert main(command) == 2
    assert "listen: got 'tcp/0.0.0.0:7447'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_axes_are_numbers(capsys: Any) -> None:
    with pytest.raises(SystemExit):
        main(["ros2", "--twin", "--axes", "1", "-2", "0"])
    assert "--axes" in capsys.readouterr().err


def line(running: subprocess.Popen[str]) -> str:
    """The next line of a process; its errors, if there is none."""
    assert running.stdout is not None
    text = running.stdout.readline()
    if not text:
        raise AssertionError(running.communicate()[1])
    return text
