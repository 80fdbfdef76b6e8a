"""Drives and master in two processes: the motors stop however either ends."""

import json
import os
import pty
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import Empty, Queue
from typing import Any

import pytest
from drive_settings import drives_document
from serial_settings import serial_document
from tautscope.config import dump_config, from_document, load_config
from waiting import TIMEOUT

DOFS = {"insertion", "rotation", "bending"}


class Lines:
    """Lines of JSON that a process writes."""

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
        """Lines up to the last of `times` events `what`."""
        lines: list[dict[str, Any]] = []
        while sum(line.get("what") == what for line in lines) < times:
            try:
                lines.append(json.loads(self._queue.get(timeout=TIMEOUT)))
            except Empty:
                pytest.fail(f"no {what!r} after {lines}")
        return lines

    def join(self) -> None:
        self._thread.join(TIMEOUT)
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
            running.wait(TIMEOUT)
        finally:
            running.kill()
            running.wait()
            lines.join()
            running.stderr.close()


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[tuple[Path, subprocess.Popen[str], Lines]]:
    """The configuration file and the process of the drives."""
    socket = tmp_path / "can"
    config = from_document({"drives": drives_document(channel=str(socket))})
    file = tmp_path / "rig.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    arguments = ("-m", "tautscope.bench.any_motors", "--config", str(file))
    with process(*arguments) as (bench, lines):
        lines.until("ready")
        yield file, bench, lines


def test_a_wrong_request_is_told_and_the_next_is_served(
    rig: tuple[Path, subprocess.Popen[str], Lines],
) -> None:
    _, bench, lines = rig
    assert bench.stdin is not None
    print("\nmelt rotation\nfreeze tail\nfreeze", file=bench.stdin)
    print("freeze rotation", file=bench.stdin, flush=True)
    lines.until("fault: freeze")


@pytest.mark.parametrize(
    ("changes", "arguments", "message"),
    [
        ({}, ("--start", "0", "0"), "--start: got [0.0, 0.0], expected 3 positions"),
        ({"protocol": "serial", "channel": "/dev/ttyACM0"}, (), "drives.channel: got '/dev/tty"),
        (None, (), "File not found"),
    ],
)
def test_bad_input_ends_simulated_motors_with_one_line(
    changes: dict[str, Any] | None, arguments: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    file = tmp_path / "rig.toml"
    if changes is not None:
        document = serial_document(tmp_path, **changes) if changes else drives_document()
        file.write_text(dump_config(from_document({"drives": document})), encoding="utf-8")
    options = ("-m", "tautscope.bench.any_motors", "--config", str(file), *arguments)
    with process(*options) as (motors, _):
        assert motors.wait(TIMEOUT) == 2
        (line,) = motors.stderr.read().splitlines()
    assert line.startswith(f"error: {message}")


MASTER = str(Path(__file__).with_name("master.py"))


@contextmanager
def running_master(file: Path, lines: Lines) -> Iterator[subprocess.Popen[str]]:
    with process(MASTER, str(file), "signal") as (master, output):
        lines.until("operation enabled", 3)
        output._queue.get(timeout=TIMEOUT)
        yield master


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
    """After SIGKILL the drives miss the heartbeat; otherwise the master commands a quick stop."""
    file, _, lines = rig
    how = ending if isinstance(ending, str) else "signal"
    with process(MASTER, str(file), how) as (master, output):
        lines.until("operation enabled", 3)
        if isinstance(ending, signal.Signals):
            output._queue.get(timeout=TIMEOUT)
            master.send_signal(ending)
        stopped = lines.until("quick stop active", 3)
        assert {line["dof"] for line in stopped if line["what"] == "quick stop active"} == DOFS
        assert master.wait(TIMEOUT) == status
    assert not any(line["what"] == "fault" for line in stopped)


def test_master_reports_lost_drives(
    rig: tuple[Path, subprocess.Popen[str], Lines],
) -> None:
    file, bench, lines = rig
    with running_master(file, lines) as master:
        bench.kill()
        assert master.wait(TIMEOUT) == 1
        assert master.stderr is not None
        text = master.stderr.read()
    assert "BusError: CAN bus: the connection is lost" in text
    assert "Use the emergency stop" in text


def test_fault_injected_through_standard_input(
    rig: tuple[Path, subprocess.Popen[str], Lines],
) -> None:
    file, bench, lines = rig
    with running_master(file, lines) as master:
        assert bench.stdin is not None
        bench.stdin.write("fault bending\n")
        bench.stdin.flush()
        lines.until("quick stop active", 2)
        assert master.wait(TIMEOUT) == 1
        assert master.stderr is not None
        assert "EmergencyError: bending, node 3: emergency 0x4310" in master.stderr.read()


TERMINAL = """
import fcntl, subprocess, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
job = subprocess.Popen([sys.executable, *sys.argv[1:]], process_group=0)
print(job.pid, flush=True)
sys.exit(job.wait())
"""
"""As a shell with job control does on a terminal."""
BACKGROUND = {
    "null device": ["sh", "-c", '"$0" "$@" & echo $!; wait $!', sys.executable],
    "closed": ["sh", "-c", '"$0" "$@" <&- & echo $!; wait $!', sys.executable],
    "terminal": [sys.executable, "-c", TERMINAL],
}
"""Shells that start a process in the background and print its number."""


@contextmanager
def background(nothing: str, *arguments: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    ours, theirs = pty.openpty()
    shell = subprocess.Popen(
        [*BACKGROUND[nothing], *arguments],
        stdin=theirs,
        stdout=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert shell.stdout is not None
    job = int(shell.stdout.readline())
    try:
        assert "ready" in shell.stdout.readline()
        yield shell, job
        shell.wait(TIMEOUT)
    finally:
        with suppress(ProcessLookupError):
            os.kill(job, signal.SIGKILL)
        shell.wait()
        shell.stdout.close()
        os.close(ours)
        os.close(theirs)


@pytest.mark.parametrize(
    ("nothing", "ending", "status"),
    [
        ("null device", signal.SIGINT, 0),
        ("closed", signal.SIGTERM, 128 + signal.SIGTERM),
        ("terminal", signal.SIGTERM, 128 + signal.SIGTERM),
    ],
)
def test_drives_in_the_background_serve_a_master_until_a_signal(
    tmp_path: Path, nothing: str, ending: signal.Signals, status: int
) -> None:
    socket, file = tmp_path / "can", tmp_path / "rig.toml"
    config = from_document({"drives": drives_document(channel=str(socket))})
    file.write_text(dump_config(config), encoding="utf-8")
    arguments = ("-m", "tautscope.bench.any_motors", "--config", str(file))
    with background(nothing, *arguments) as (shell, job):
        with process(MASTER, str(file), "return") as (master, _):
            assert master.wait(TIMEOUT) == 0
        assert shell.poll() is None
        os.kill(job, ending)
    assert shell.returncode == status
    assert not socket.exists()


def bench_file(folder: Path) -> tuple[Path, Path, Path]:
    """A bench's configuration file and its two sockets."""
    file, can, video = folder / "rig.toml", folder / "can", folder / "video"
    changes = {"drives.channel": str(can), "camera.source.url": f"unix:{video}"}
    file.write_text(dump_config(load_config("bench").replace(**changes)), encoding="utf-8")
    return file, can, video


@pytest.mark.parametrize("ending", [signal.SIGTERM, signal.SIGINT])
def test_bench_in_the_background_ends_with_a_signal(tmp_path: Path, ending: signal.Signals) -> None:
    """`tautscope bench &`: it goes on without input, and leaves no socket behind."""
    file, can, video = bench_file(tmp_path)
    with background("null device", "-m", "tautscope", "bench", "--config", str(file)) as (
        shell,
        job,
    ):
        time.sleep(0.3)  # an input that has ended would have ended it
        assert shell.poll() is None
        assert can.exists()
        assert video.exists()
        os.kill(job, ending)
    assert shell.returncode == (128 + ending if ending is signal.SIGTERM else 0)
    assert not can.exists()
    assert not video.exists()


def test_a_full_disk_ends_the_bench(tmp_path: Path) -> None:
    file, can, video = bench_file(tmp_path)
    command = ("-m", "tautscope", "bench", "--config", str(file), "--truth", "/dev/full")
    with process(*command) as (bench, _):
        assert bench.wait(TIMEOUT) == 2
        assert bench.stderr is not None
        assert bench.stderr.read() == (
            "error: --truth: got '/dev/full', expected a file that can be written "
            "([Errno 28] No space left on device)\n"
        )
    assert not can.exists()
    assert not video.exists()


def test_the_bench_ends_when_nobody_reads_its_events(tmp_path: Path) -> None:
    file, can, video = bench_file(tmp_path)
    command = [sys.executable, "-m", "tautscope", "bench", "--config", str(file)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as bench:
        assert bench.stdin is not None
        assert bench.stdout is not None
        assert bench.stderr is not None
        assert json.loads(bench.stdout.readline())["what"] == "ready"
        bench.stdout.close()
        bench.stdin.write("freeze rotation\n")
        bench.stdin.flush()
        assert bench.wait(TIMEOUT) == 141
        assert not bench.stderr.read()
    assert not can.exists()
    assert not video.exists()
