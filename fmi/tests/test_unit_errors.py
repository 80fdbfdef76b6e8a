"""The units in FMPy: errors that say what was wrong, and no process that is left."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import build
import numpy as np
import pytest
from conftest import Builder
from fmpy.fmi1 import FMICallException
from fmu import CONFIG, PERIOD, Unit
from tautscope import axes
from tautscope.errors import ConfigError


@contextmanager
def refused(unit: Unit, words: str) -> Iterator[None]:
    with pytest.raises(FMICallException):
        yield
    assert words in " ".join(unit.messages), unit.messages


def test_bad_use_is_an_error_with_a_message(opened: Callable[..., Unit]) -> None:
    twin, loop = opened("twin", has_camera=False), opened("loop")
    with refused(twin, "got 0.007 s, expected one or more control periods of 0.005 s"):
        twin.step(0.0, 0.007)
    with refused(twin, "cannot be set after the initialization"):
        twin.set("seed", 1)
    with refused(twin, "because it is an output"):
        twin.set("true_bending", 0.0)
    with refused(loop, "reference"):
        loop.set_all("reference", np.array([np.nan, 0, 0]))
        loop.step(0.0)
    with refused(loop, "not initialized, or has failed"):
        loop.step(0.0)
    with refused(twin, "command"):
        twin.set_all("command", np.array([np.nan, 0, 0]))
        twin.step(0.0)


def test_a_robot_without_a_unit_is_refused_by_name(opened: Callable[..., Unit]) -> None:
    robot = axes(2, width_limit=1.2, names=["bend_x", "bend_y"])
    with pytest.raises(ConfigError, match=r"dof: got \['bend_x', 'bend_y'\], expected none"):
        opened("twin", robot)
    with pytest.raises(
        RuntimeError, match=r'kinematics\.kind: got "two_planes", expected "joints"'
    ):
        opened("loop", robot.replace(**{"kinematics.kind": "two_planes"}))


def test_a_name_that_makes_two_variables_equal_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"dof\[1\]\.name: got 'age'"):
        build.variables_of("loop", axes(2, width_limit=1.2, names=["bend", "age"]))


@pytest.mark.parametrize(
    "case",
    [
        ("missing/twin.fmu", "cc", "--out: got missing/twin.fmu, expected a file in a folder"),
        (".", "cc", "--out: got ., expected a file in a folder that exists"),
        ("twin.fmu", "no-such-cc", "CC: got 'no-such-cc', expected a C compiler"),
        ("twin.fmu", "false", "CC: false ended with status 1"),
        ("/dev/full", "cc", "--out: [Errno 28]"),
    ],
)
def test_a_unit_that_cannot_be_built_is_one_line(
    case: tuple[str, str, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out, compiler, words = case
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CC", compiler)
    monkeypatch.setattr(sys, "argv", ["build.py", "twin", "--out", out])
    with pytest.raises(SystemExit) as ended:
        build.main()
    assert ended.value.code == 2
    assert words in capsys.readouterr().err.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []


def test_an_interpreter_that_does_not_exist_is_named(opened: Callable[..., Unit]) -> None:
    with pytest.raises(RuntimeError, match="/no/such/python cannot be started: No such file"):
        opened("twin", python="/no/such/python")
    with pytest.raises(
        RuntimeError, match=r"has ended; was it started\? Parameter python: /bin/true"
    ):
        opened("twin", python="/bin/true")


def children() -> set[int]:
    tasks = Path("/proc/self/task").glob("*/children")
    return {int(child) for task in tasks for child in task.read_text().split()}


def test_a_killed_process_is_an_error_and_none_is_left(opened: Callable[..., Unit]) -> None:
    before = children()
    unit = opened("twin", has_camera=False)
    (process,) = children() - before
    os.kill(process, signal.SIGKILL)
    with refused(unit, "the Python process has ended"):
        unit.step(0.0)
    other = opened("twin", has_camera=False)
    assert len(children() - before) == 2, "the killed one is waited for when its unit is released"
    unit.reset()
    assert process not in children()
    other.terminate()
    assert len(children() - before) == 1


HANGING = """#!{python} -IS
import os, signal, socket
channel = socket.socket(fileno=0)
channel.send(bytes(8 * 14 * {replies}))
os.kill(os.getpid(), signal.SIGSTOP)
"""
"""A process that sends replies and then stops, so that it neither answers nor ends."""


def test_a_process_that_hangs_is_an_error_and_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build, "TIME_LIMIT", 3)
    build.build("twin", tmp_path / "twin.fmu", CONFIG)
    before = children()
    hanging = tmp_path / "hanging"

    def open_unit(replies: int) -> Unit:
        hanging.write_text(HANGING.format(python=sys.executable, replies=replies))
        hanging.chmod(0o755)
        return Unit(tmp_path / "twin.fmu", tmp_path / f"unit_{replies}", python=str(hanging))

    words = "s. Reset and initialize the unit: this ends the process"
    with pytest.raises(RuntimeError, match=f"not answered for 3 {words}"):
        open_unit(replies=0)
    assert children() == before
    unit = open_unit(replies=1)
    with refused(unit, f"not answered for 4 {words}"):
        unit.step(0.0)
    assert len(children() - before) == 1
    unit.reset()
    with refused(unit, f"not answered for 5 {words}"):
        unit.step(0.0, 2 * PERIOD)
    unit.terminate()
    assert children() == before
    unit.close()


def test_the_process_ends_with_the_importer(builder: Builder, tmp_path: Path) -> None:
    program = """
import os, pathlib, sys, fmu
unit = fmu.Unit(*map(pathlib.Path, sys.argv[1:]))
print(pathlib.Path(f"/proc/self/task/{os.getpid()}/children").read_text(), flush=True)
os.kill(os.getpid(), 9)
"""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", program, str(builder("twin", CONFIG)), str(tmp_path)]
    importer = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert importer.returncode == -signal.SIGKILL, importer.stderr
    process = Path("/proc") / importer.stdout.strip()
    assert process.name.isdigit()
    deadline = time.monotonic() + 20
    while process.exists() and "zombie" not in (process / "status").read_text():
        assert time.monotonic() < deadline, "the process of the twin is still running"
        time.sleep(0.05)
