"""Stopping time of the drives, and jitter of the set-points, over the bus between two processes.

One process simulates the drives, this one controls them with the timing of
`tautscope.config.DrivesConfig` (100 Hz, heartbeats of 20 ms, lost after 80 ms). A stopping time is
measured by the drives, on the monotonic clock: from the fault to the quick stop of the last drive
that can stop. ``--seconds`` is the duration of the stream of set-points; ``--realtime`` requests
SCHED_FIFO for both processes.
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

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from bench.processes import BENCH, Rig
from tautscope.config import DrivesConfig, dump_config, load_config
from tautscope.errors import DriveError
from tautscope.hardware.drives import Drives, open_drives

SPEED = np.array([0.01, 1.5, 0.8])
"""Largest speed of the motors [m/s, rad/s, rad/s]."""
FAULTS = {
    "heartbeat": ("heartbeat of a drive lost", 100.0),
    "drop": ("a drive silent", 100.0),
    "delay": ("a drive answers 0.3 s late", 100.0),
    "fault": ("a drive's emergency", 100.0),
    "refuse": ("a drive leaves its mode", 100.0),
    "freeze": ("a motor stands still at full test speed", None),
}


@contextmanager
def simulated_drives(folder: Path) -> Iterator[tuple[Path, Rig]]:
    """Start the simulated drives; yield the configuration file, and their process."""
    socket, file = folder / "can", folder / "rig.toml"
    config = load_config(BENCH).replace(**{"drives.channel": str(socket)})
    file.write_text(dump_config(config), encoding="utf-8")
    command = [sys.executable, "-m", "tautscope.bench.drives"]
    command += ["--config", str(file), "--socket", str(socket)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        drives = Rig(process)
        drives.event("ready")
        yield file, drives
        process.communicate()


def drives_config(file: Path) -> DrivesConfig:
    """Load the settings of the drives."""
    config = load_config(file).drives
    assert config is not None
    return config


def stream(drives: Drives, seconds: float, begin: np.ndarray) -> list[float]:
    """Send set-points at the rate of the drives; return the duration of each exchange [ms]."""
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


def last_stop(process: Rig, stops: int) -> float:
    """Return when the last of so many drives stopped [s]."""
    return max(process.event("quick stop active") for _ in range(stops))


def stop_times(kind: str, repeats: int) -> list[float]:
    """Return the times from a fault to the quick stop of all drives that can stop [ms]."""
    times = []
    for _ in range(repeats):
        with (
            tempfile.TemporaryDirectory() as folder,
            simulated_drives(Path(folder)) as (file, process),
        ):
            try:
                with open_drives(drives_config(file)) as drives:
                    begin = drives.start()
                    stream(drives, 0.3, begin)
                    process.request(f"{kind} rotation")
                    stream(drives, 10.0, drives.last_command)
            except DriveError:
                began = process.event(f"fault: {kind}")
                times.append((last_stop(process, 2) - began) * 1e3)
            else:
                raise RuntimeError(f"the fault {kind!r} was not detected")
    return times


def killed_times(number: int, repeats: int) -> list[float]:
    """Return the times from a signal to the controller to the quick stop of all drives [ms]."""
    times = []
    for _ in range(repeats):
        with (
            tempfile.TemporaryDirectory() as folder,
            simulated_drives(Path(folder)) as (file, process),
        ):
            command = [sys.executable, str(Path(__file__).parent), "--follow", str(file)]
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
    """Control the drives until a signal arrives."""
    from tautscope.hardware.signals import exit_on_signals  # noqa: PLC0415

    with exit_on_signals(), open_drives(drives_config(Path(file))) as drives:
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
        simulated_drives(Path(folder)) as (file, _),
        open_drives(drives_config(file)) as drives,
    ):
        took = stream(drives, seconds, drives.start())
        traffic = drives.statistics
    answers = 3 * traffic.cycles
    return [
        row("set-point to answer, 100 Hz", "ms", took, None),
        row("answers lost", "answers", [float(sum(traffic.lost))], 0.0) | {"n": answers},
        row("answers later than 6 ms", "answers", [float(sum(traffic.late))], None)
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
        what = f"{number.name} to the controller, to quick stop"
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
