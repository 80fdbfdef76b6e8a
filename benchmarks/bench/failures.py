"""Runs on the bench with a fault of the camera, or with a wrong configuration.

Faults of the motors are those of benchmarks/drives.
"""

import argparse
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from bench.processes import TIMEOUT, Rig, bench_config, run, start_rig
from tautscope.config import Config, dump_config

FAULTS = {
    "camera unplugged": ("fault camera", "camera.source: got 'no image"),
    "camera frozen": ("freeze camera", "camera.source: got 'only repetitions"),
}
"""Request of each fault, and how the error message that ends the run begins."""
WRONG: dict[str, tuple[dict[str, Any], str]] = {
    "wrong node id": ({"drives.rotation.node": 9}, "rotation, node 9: no answer"),
    "wrong sign, insertion": ({"drives.insertion.sign": -1}, "insertion, node 1: position"),
    "wrong sign, rotation": ({"drives.rotation.sign": 1}, "drives.rotation"),
    "wrong sign, bending": ({"drives.bending.sign": -1}, "bending, node 3: position"),
    "counts per mm, insertion": (
        {"drives.insertion.counts_per_unit": 1e3},
        "insertion, node 1: position",
    ),
    "counts per degree, rotation": (
        {"drives.rotation.counts_per_unit": 1e4 * np.pi / 180},
        "rotation, node 2: following error",
    ),
    "degrees for counts per rad, rotation": (
        {"drives.rotation.counts_per_unit": 1e4 * 180 / np.pi},
        "rotation, node 2: following error",
    ),
    "counts per degree, bending": (
        {"drives.bending.counts_per_unit": 1e4 * np.pi / 180},
        "bending, node 3: position",
    ),
}
"""Change of the configuration, and how the error message that ends the run begins."""
ENDED_BY_ERROR = (2, 3, 4)
"""Exit statuses of `tautscope run` after an error."""
UNPLUGGED = 3.0
"""How long the camera is unplugged [s]."""


def run_faults(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Inject each fault into its own run; return the error and the time until the quick stop."""
    rows = []
    for what, (request, message) in FAULTS.items():
        with _running_rig(arguments) as (folder, rig, _):
            process = _start_moving(folder, rig)
            rig.request(request)
            began = rig.event(f"fault: {request.split()[0]}")
            stopped = rig.event("quick stop active", "bending")
            _, errors = process.communicate(timeout=TIMEOUT)
        row = _row(what, process.returncode, errors, 1e3 * (stopped - began))
        rows.append(row | {"holds": _ended_by(row, message)})
    rows.append(_run_replugged(arguments))
    return rows


def _run_replugged(arguments: argparse.Namespace) -> dict[str, Any]:
    """Unplug the camera for some time; the run continues."""
    with _running_rig(arguments) as (folder, rig, _):
        process = _start_moving(folder, rig)
        rig.request("fault camera")
        time.sleep(UNPLUGGED)
        rig.request("clear camera")
        began, lines = time.monotonic(), []
        assert process.stderr is not None
        for line in process.stderr:
            lines.append(line)
            if "frames again" in line:
                break
        took = 1e3 * (time.monotonic() - began)
        process.terminate()
        rig.event("quick stop active", "bending")
        process.communicate(timeout=TIMEOUT)
    warnings = " / ".join(line.strip() for line in lines if line.startswith("warning"))
    return _row(f"camera back after {UNPLUGGED:g} s", None, warnings, took)


def run_wrong(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Run each wrong configuration on a correct rig; return the error, and the time of motion."""
    rows = []
    for what, (changes, message) in WRONG.items():
        with _running_rig(arguments) as (folder, rig, config):
            file = folder / "wrong.toml"
            file.write_text(dump_config(config.replace(**changes)), encoding="utf-8")
            process = run(file, folder / "run")
            _, errors = process.communicate()
            rig.request("clear camera")  # its event ends the list of events
            events = rig.until("fault: clear")
        enabled = [at for at, event in events if event == "operation enabled"]
        stopped = [at for at, event in events if event == "quick stop active"]
        took = 1e3 * (max(stopped) - min(enabled)) if enabled and stopped else None
        row = _row(what, process.returncode, errors, took)
        rows.append(row | {"holds": _ended_by(row, message)})
    return rows


@contextmanager
def _running_rig(arguments: argparse.Namespace) -> Iterator[tuple[Path, Rig, Config]]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        config = bench_config(folder, arguments)
        with start_rig(config, folder) as rig:
            yield folder, rig, config


def _start_moving(folder: Path, rig: Rig) -> subprocess.Popen[str]:
    process = run(folder / "rig.toml", folder / "run")
    rig.event("operation enabled", "bending")
    time.sleep(4.0)
    return process


def _ended_by(row: dict[str, Any], message: str) -> bool:
    return row["status"] in ENDED_BY_ERROR and row["said"].startswith(f"error: {message}")


def _row(what: str, status: int | None, errors: str, took: float | None) -> dict[str, Any]:
    said = [line for line in errors.splitlines() if line.startswith(("error", "warning"))]
    return {"what": what, "status": status, "ms": took, "said": said[-1] if said else errors[-300:]}
