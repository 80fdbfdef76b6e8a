"""Stopping time of the motors, and jitter of the set-points, over the bus between two processes.

One process simulates the motors of a configuration, this one controls them (``bench``: CiA 402
drives at 100 Hz, heartbeats of 20 ms, lost after 80 ms). A stopping time is measured on the
monotonic clock: of CiA 402 drives from the fault to the quick stop of the last drive that can stop;
of motors on a serial line to the error of the controller, which has told them to hold before (and
has asked a silent one to for a second), and after the end of the controller to the stop by the
watchdog, which a Feetech servo has not. ``--seconds`` is the duration of the stream of set-points;
``--realtime`` requests SCHED_FIFO for both processes.
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
from bench.processes import Rig
from tautscope.config import (
    Config,
    DrivesConfig,
    dump_config,
    from_document,
    load_config,
    to_document,
)
from tautscope.dof import Dof
from tautscope.errors import DriveError
from tautscope.hardware.drives import Drives, open_drives

BENCH = "bench"
SPEEDS = {"mm": 0.01, "rad": 1.5}
"""Largest speed of a motor [m/s, rad/s], by its unit in tables."""
FAULTS: dict[str, tuple[str, float | None]] = {
    "drop": ("a drive silent", 100.0),
    "delay": ("a drive answers 0.3 s late", 100.0),
    "fault": ("a drive's emergency", 100.0),
    "freeze": ("a motor stands still at full test speed", None),
}
OF_CIA_402: dict[str, tuple[str, float | None]] = {
    "heartbeat": ("heartbeat of a drive lost", 100.0),
    "refuse": ("a drive leaves its mode", 100.0),
}
ON_LINE: dict[str, tuple[str, float | None]] = {"restart": ("supply fails for a moment", None)}
STOPS = {"canopen": "quick stop active", "dynamixel": "bus watchdog", "serial": "silence"}
"""Event of the motors after the end of the controller, by protocol."""


@contextmanager
def simulated_drives(folder: Path, bench: Config) -> Iterator[tuple[Path, Rig]]:
    """Start the simulated motors; yield the configuration file, and their process."""
    file = folder / "rig.toml"
    config = bench.replace(**{"drives.channel": str(folder / "bus")})
    file.write_text(dump_config(config), encoding="utf-8")
    command = [sys.executable, "-m", "tautscope.bench.any_motors", "--config", str(file)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        drives = Rig(process)
        drives.event("ready")
        yield file, drives
        process.communicate()


def with_motors(bench: Config, count: int) -> Config:
    """A robot of so many motors, each as that of rotation on the bench."""
    document = to_document(bench)
    names = [f"joint_{number}" for number in range(1, count + 1)]
    drives = document["drives"]
    own = drives["rotation"]
    for dof in Dof:
        del drives[dof.label]
    drives["motors"] = {name: own | {"node": at} for at, name in enumerate(names, start=1)}
    document["dof"] = [{"name": name, "width_limit": 1.0} for name in names]
    return from_document(document)


def drives_config(file: Path) -> DrivesConfig:
    """Load the settings of the drives."""
    config = load_config(file).drives
    assert config is not None
    return config


def stream(drives: Drives, seconds: float, begin: np.ndarray) -> list[float]:
    """Send set-points at the rate of the drives; return the duration of each exchange [ms]."""
    took = []
    speed = np.array([SPEEDS[motor.display_unit] for motor in drives.config.all_motors])
    start = time.monotonic()
    for count in range(round(seconds / drives.cycle)):
        due = start + count * drives.cycle
        time.sleep(max(0.0, due - time.monotonic()))
        phase = 2 * np.pi * 0.5 * count * drives.cycle
        before = time.perf_counter()
        drives.exchange(begin + speed / np.pi * np.sin(phase))
        took.append((time.perf_counter() - before) * 1e3)
    return took


def last_stop(process: Rig, stops: int, what: str) -> float:
    """Return when the last of so many drives stopped [s]."""
    return max(process.event(what) for _ in range(stops))


def stop_times(kind: str, repeats: int, bench: Config) -> list[float]:
    """Return the times from a fault to the stop [ms], see above."""
    times = []
    assert bench.drives is not None
    motors = bench.drives.all_motors
    for _ in range(repeats):
        with (
            tempfile.TemporaryDirectory() as folder,
            simulated_drives(Path(folder), bench) as (file, process),
        ):
            try:
                with open_drives(drives_config(file)) as drives:
                    begin = drives.start()
                    stream(drives, 0.3, begin)
                    process.request(f"{kind} {motors[1].label}")
                    try:
                        stream(drives, 10.0, drives.last_command)
                    finally:
                        stopped = time.monotonic()
            except DriveError:
                began = process.event(f"fault: {kind}")
                if bench.drives.protocol == "canopen":
                    stopped = last_stop(process, len(motors) - 1, STOPS["canopen"])
                times.append((stopped - began) * 1e3)
            else:
                raise RuntimeError(f"the fault {kind!r} was not detected")
    return times


def killed_times(number: int, repeats: int, bench: Config, stop: str) -> list[float]:
    """Return the times from a signal to the controller to the stop of all drives [ms]."""
    times = []
    assert bench.drives is not None
    count = len(bench.drives.all_motors)
    for _ in range(repeats):
        with (
            tempfile.TemporaryDirectory() as folder,
            simulated_drives(Path(folder), bench) as (file, process),
        ):
            command = [sys.executable, str(Path(__file__).parent), "--follow", str(file)]
            with subprocess.Popen(
                command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
            ) as master:
                assert master.stdout is not None
                master.stdout.readline()
                began = time.monotonic()
                master.send_signal(number)
                times.append((last_stop(process, count, stop) - began) * 1e3)
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


def streaming_rows(seconds: float, bench: Config) -> list[dict[str, Any]]:
    with (
        tempfile.TemporaryDirectory() as folder,
        simulated_drives(Path(folder), bench) as (file, _),
        open_drives(drives_config(file)) as drives,
    ):
        took = stream(drives, seconds, drives.start())
        traffic = drives.statistics
    answers = len(traffic.lost) * traffic.cycles
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
    parser.add_argument("--config", default=BENCH, help="bench, bench_dynamixel, ... [bench]")
    parser.add_argument("--motors", type=int, help="of a robot with so many, in place of three")
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
    bench, repeats = load_config(arguments.config), arguments.repeats
    if arguments.motors is not None:
        bench = with_motors(bench, arguments.motors)
    assert bench.drives is not None
    protocol = bench.drives.protocol
    rows = streaming_rows(arguments.seconds, bench)
    is_cia_402 = protocol == "canopen"
    # A controller that is told to end holds motors on a line where they are, without an event.
    for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)[: 3 if is_cia_402 else 1]:
        if stop := STOPS.get(protocol):
            what = f"{number.name} to the controller, to {stop}"
            rows.append(row(what, "ms", killed_times(number, repeats, bench, stop), 100.0))
    end = "to quick stop" if is_cia_402 else "to the error of the controller"
    for kind, (what, limit) in (FAULTS | (OF_CIA_402 if is_cia_402 else ON_LINE)).items():
        goal = limit if is_cia_402 else None
        rows.append(row(f"{what}, {end}", "ms", stop_times(kind, repeats, bench), goal))
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
