"""The units in FMPy: errors that say what was wrong, and no process that is left."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from conftest import Builder
from fmpy.fmi1 import FMICallException
from fmu import CONFIG, Unit


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


def test_an_interpreter_that_does_not_exist_is_named(opened: Callable[..., Unit]) -> None:
    with pytest.raises(RuntimeError, match="/no/such/python cannot be started: No such file"):
        opened("twin", python="/no/such/python")
    with pytest.raises(
        RuntimeError, match=r"has ended; was it started\? Parameter python: /bin/true"
    ):
        opened("twin", python="/bin/true")


def test_a_killed_process_is_an_error_and_none_is_left(opened: Callable[..., Unit]) -> None:
    def children() -> set[int]:
        tasks = Path("/proc/self/task").glob("*/children")
        return {int(child) for task in tasks for child in task.read_text().split()}

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
