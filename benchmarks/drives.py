"""How fast motors stop, and how punctual set-points are, over the bus between two processes.

The drives are simulated, in a process of their own; this one commands them with the times of
`tautscope.config.DrivesConfig` (100 Hz, heartbeats of 20 ms, lost after 80 ms). Times are between
the drives' own records of the fault and of the quick stop of the last drive that can, on the
computer's monotonic clock. ``--seconds`` is how long set-points are streamed; ``--realtime`` asks
for SCHED_FIFO for both processes.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from doc_pages import ROOT
from tautscope.config import DrivesConfig, dump_config, load_config
from tautscope.errors import DriveError
from tautscope.hardware.drives import Drives, open_drives

SPEED = np.array([0.01, 1.5, 0.8])
"""Of the motors while something goes wrong [m/s, rad/s, rad/s]."""
FAULTS = {
    "heartbeat": ("heartbeat of a drive lost", 100.0),
    "drop": ("a drive silent", 100.0),
    "delay": ("a drive answers 0.3 s late", 100.0),
    "fault": ("a drive's emergency", 100.0),
    "refuse": ("a drive leaves its mode", 100.0),
    "freeze": ("a motor stands still at full test speed", None),
}


@contextmanager
def rig(folder: Path) -> Iterator[tuple[Path, subprocess.Popen[str]]]:
    """Simulated drives; the file that names them, and their process."""
    socket, file = folder / "can", folder / "rig.toml"
    bench = load_config(ROOT / "configs" / "bench.toml")
    config = bench.replace(**{"drives.channel": str(socket)})
    file.write_text(dump_config(config), encoding="utf-8")
    command = [sys.executable, "-m", "tautscope.bench.drives"]
    command += ["--config", str(file), "--socket", str(socket)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        event(process, "ready")
        yield file, process
        process.communicate()


def event(process: subprocess.Popen[str], what: str) -> dict[str, Any]:
    """The next event of this kind."""
    assert process.stdout is not None
    for line in process.stdout:
        found: dict[str, Any] = json.loads(line)
        if found["what"] == what:
            return found
    raise RuntimeError(f"the drives ended before {what!r}")


def settings(file: Path) -> DrivesConfig:
    config = load_config(file).drives
    assert config is not None
    return config


def stream(drives: Drives, seconds: float, begin: np.ndarray) -> list[float]:
    """Set-points at the drives' rate; how long each exchange took [ms]."""
    took = []
    start = time.monotonic()
    for count in range(round(seconds / drives.cycle)):
        due = start + count * drives.cycle
        time.sleep(max(0.0, due - time.monotonic()))
        phase = 2 * np.pi * 0.5 * count * drives.cycle
        before = time.perf_counter()
        drives.exchange(begin + SPEED / np.pi * np.sin(phase))
        took.append((time.perf_counter() - before) * 1e3)
    return took


def last_stop(process: subprocess.Popen[str], stops: int) -> float:
    return max(event(process, "quick stop active")["time"] for _ in range(stops))


def stop_times(kind: str, repeats: int) -> list[float]:
    """From a fault to the quick stop of all drives that still can [ms]."""
    times = []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder, rig(Path(folder)) as (file, process):
            try:
                with open_drives(settings(file)) as drives:
                    begin = drives.start()
                    stream(drives, 0.3, begin)
                    assert process.stdin is not None
                    process.stdin.write(f"{kind} rotation\n")
                    process.stdin.flush()
                    stream(drives, 10.0, drives.last_command)
            except DriveError:
                began = event(process, f"fault: {kind}")["time"]
                times.append((last_stop(process, 2) - began) * 1e3)
            else:
                raise RuntimeError(f"{kind} was not noticed")
    return times


def killed_times(number: int, repeats: int) -> list[float]:
    """From a signal to the process that commands to the quick stop of all drives [ms]."""
    times = []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder, rig(Path(folder)) as (file, process):
            command = [sys.executable, __file__, "--follow", str(file)]
            with subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
            ) as master:
                assert master.stdout is not None
                master.stdout.readline()
                began = time.monotonic()
                master.send_signal(number)
                times.append((last_stop(process, 3) - began) * 1e3)
    return times


def follow(file: str) -> None:
    """Command the drives until a signal comes."""
    from tautscope.hardware.signals import exit_on_signals  # noqa: PLC0415

    with exit_on_signals(), open_drives(settings(Path(file))) as drives:
        begin = drives.start()
        stream(drives, 0.5, begin)
        print("running", flush=True)
        stream(drives, 600.0, drives.last_command)


def row(what: str, unit: str, values: list[float], goal: float | None) -> dict[str, Any]:
    worst = max(values)
    return {
        "what": what,
        "unit": unit,
        "median": statistics.median(values),
        "p99": float(np.percentile(values, 99)),
        "worst": worst,
        "n": len(values),
        "goal": goal,
        "holds": None if goal is None else worst <= goal,
    }


def streaming_rows(seconds: float) -> list[dict[str, Any]]:
    with (
        tempfile.TemporaryDirectory() as folder,
        rig(Path(folder)) as (file, _),
        open_drives(settings(file)) as drives,
    ):
        took = stream(drives, seconds, drives.start())
        traffic = drives.statistics
    answers = 3 * traffic.cycles
    return [
        row("set-points to answers, 100 Hz", "ms", took, None),
        row("answers that came never", "answers", [float(sum(traffic.lost))], 0.0) | {"n": answers},
        row("answers that came later than 6 ms", "answers", [float(sum(traffic.late))], None)
        | {"n": answers},
        row("longest time between two set-points", "ms", [traffic.longest_pause * 1e3], None)
        | {"n": traffic.cycles},
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--realtime", action="store_true")
    parser.add_argument("--follow", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.realtime:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(60))  # children inherit it
    if arguments.follow:
        follow(arguments.follow)
        return
    repeats = arguments.repeats
    rows = streaming_rows(arguments.seconds)
    for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT):
        what = f"{number.name} to what commands, to quick stop"
        rows.append(row(what, "ms", killed_times(number, repeats), 100.0))
    for kind, (what, goal) in FAULTS.items():
        rows.append(row(f"{what}, to quick stop", "ms", stop_times(kind, repeats), goal))
    if arguments.json:
        print(
            json.dumps(
                {"cpus": os.cpu_count(), "realtime": arguments.realtime, "rows": rows}, indent=1
            )
        )
        return
    for line in rows:
        goal = "" if line["goal"] is None else f"  goal {line['goal']:g}"
        print(
            f"{line['what']:60} median {line['median']:7.2f}  p99 {line['p99']:7.2f}  "
            f"worst {line['worst']:7.2f} {line['unit']}  n {line['n']}{goal}"
        )


if __name__ == "__main__":
    main()
