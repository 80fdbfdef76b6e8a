"""Drives in one process, what commands them in another: however either ends, motors stop."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Empty, Queue
from typing import Any

import pytest
from drive_rig import drives_document
from tautscope.config import dump_config, from_document

PATIENCE = 60.0
DOFS = {"insertion", "rotation", "bending"}


class Lines:
    """What a process writes, line by line, with patience."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._queue: Queue[str] = Queue()
        self._stream = process.stdout
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        assert self._stream is not None
        for line in self._stream:
            self._queue.put(line)

    def until(self, what: str, times: int = 1) -> list[dict[str, Any]]:
        """The lines up to the last of some of which `what` is the event."""
        lines: list[dict[str, Any]] = []
        while sum(line.get("what") == what for line in lines) < times:
            try:
                lines.append(json.loads(self._queue.get(timeout=PATIENCE)))
            except Empty:
                pytest.fail(f"no {what!r} after {lines}")
        return lines

    def join(self) -> None:
        self._thread.join(PATIENCE)
        assert self._stream is not None
        self._stream.close()


@contextmanager
def process(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], Lines]]:
    running = subprocess.Popen(
        [sys.executable, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    lines = Lines(running)
    try:
        yield running, lines
    finally:
        assert running.stdin is not None
        assert running.stderr is not None
        running.stdin.close()
        try:
            running.wait(PATIENCE)
        finally:
            running.kill()
            running.wait()
            lines.join()
            running.stderr.close()


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[tuple[Path, subprocess.Popen[str], Lines]]:
    """The configuration's file and the process of drives."""
    socket = tmp_path / "can"
    config = from_document({"drives": drives_document(channel=str(socket))})
    file = tmp_path / "rig.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    arguments = ("-m", "tautscope.bench.drives", "--config", str(file), "--socket", str(socket))
    with process(*arguments) as (bench, lines):
        lines.until("ready")
        yield file, bench, lines


MASTER = str(Path(__file__).with_name("master.py"))


@pytest.mark.parametrize(
    ("ending", "status"),
    [
        ("return", 0),
        ("raise", 1),
        ("panic", 1),
        ("exit", 3),
        (signal.SIGINT, -signal.SIGINT),
        (signal.SIGTERM, 128 + signal.SIGTERM),
        (signal.SIGKILL, -signal.SIGKILL),
    ],
    ids=str,
)
def test_motors_stop_however_the_master_ends(
    rig: tuple[Path, subprocess.Popen[str], Lines], ending: str | signal.Signals, status: int
) -> None:
    """After SIGKILL by the drives' own watch of our heartbeat, else by our command."""
    file, _, lines = rig
    how = ending if isinstance(ending, str) else "signal"
    with process(MASTER, str(file), how) as (master, said):
        lines.until("operation enabled", 3)
        if isinstance(ending, signal.Signals):
            said._queue.get(timeout=PATIENCE)
            master.send_signal(ending)
        stopped = lines.until("quick stop active", 3)
        assert {line["dof"] for line in stopped if line["what"] == "quick stop active"} == DOFS
        assert master.wait(PATIENCE) == status
    assert not any(line["what"] == "fault" for line in stopped)


def test_the_master_says_that_the_rig_is_gone(
    rig: tuple[Path, subprocess.Popen[str], Lines],
) -> None:
    file, bench, lines = rig
    with process(MASTER, str(file), "signal") as (master, said):
        lines.until("operation enabled", 3)
        said._queue.get(timeout=PATIENCE)
        bench.kill()
        assert master.wait(PATIENCE) == 1
        assert master.stderr is not None
        text = master.stderr.read()
    assert "BusError: CAN bus: it is gone" in text
    assert "Use the emergency stop" in text


def test_a_fault_by_request(rig: tuple[Path, subprocess.Popen[str], Lines]) -> None:
    file, bench, lines = rig
    with process(MASTER, str(file), "signal") as (master, said):
        lines.until("operation enabled", 3)
        said._queue.get(timeout=PATIENCE)
        assert bench.stdin is not None
        bench.stdin.write("fault bending\n")
        bench.stdin.flush()
        lines.until("quick stop active", 2)
        assert master.wait(PATIENCE) == 1
        assert master.stderr is not None
        assert "EmergencyError: bending, node 3: emergency 0x4310" in master.stderr.read()
