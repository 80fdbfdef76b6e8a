"""The article's experiment in two processes, beside the in-process twin; and what goes wrong.

One process is the rig (`tautscope bench`), another drives it (`tautscope run`), over a CAN bus and
a camera stream, at 100 Hz in real time. The first part runs the protocol with and without
compensation and compares the reductions with those of the in-process twin of the same seed,
profile, control period and history (the second run goes on with the same instrument); the bench
writes where its tip truly was, for this evaluation alone. Both logs are replayed. ``--minutes`` is
how long each run streams set-points: periods are repeated until then; a minute of log takes 1 GB.
The second part asks for faults, the third for configurations that are wrong, each in a run of its
own.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import bench_tables
import numpy as np
from bench_processes import PATIENCE, bench_config, rig, run
from numpy.typing import ArrayLike
from tautscope.bench.ground_truth import read_ground_truth
from tautscope.config import dump_config
from tautscope.dof import Dof
from tautscope.hardware.timing import read_sent
from tautscope.log.reader import read_log
from tautscope.log.replay import replay_same
from tautscope.loop.references import SineSequence
from tautscope.loop.rig import Sample
from tautscope.report import tables
from tautscope.report.results import Results, evaluate
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording
from tautscope.twin import Twin

WITHIN = 0.03
"""How far a reduction may be from the in-process twin's."""
FAULTS = {
    "a drive's emergency": ("fault rotation", "rotation, node 2: emergency 0x4310"),
    "a drive silent": ("drop rotation", "rotation, node 2: no "),
    "a drive answers 0.3 s late": ("delay rotation", "rotation, node 2: no "),
    "heartbeat of a drive lost": ("heartbeat rotation", "rotation, node 2: no heartbeat"),
    "a drive leaves its mode": ("refuse rotation", "rotation, node 2: it changed from mode"),
    "a motor stands still": ("freeze insertion", "insertion, node 1: following error"),
    "camera unplugged": ("fault camera", "camera.source: got 'no image"),
    "camera frozen": ("freeze camera", "camera.source: got 'only repetitions"),
}
"""What -> request, and how the error that ends the run begins."""
LIMITS = {"a drive's emergency": 100.0, "heartbeat of a drive lost": 100.0, "a drive silent": 100.0}
"""What -> to quick stop at most [ms]."""
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
"""What -> a change of the configuration, and how the error that ends the run begins."""
ENDED_BY_ERROR = 2
"""Exit status of `tautscope run`."""
REPLUG = 3.0
"""After how long an unplugged camera comes back [s]."""


class GoingOn(Twin):
    """The in-process twin, which a second run finds as the first has left it, as on the bench."""

    _is_used = False
    _command: np.ndarray

    def reset(self) -> Sample:
        """New at first, then a slow way to the start."""
        start = np.array([self._config.experiment[dof].centre for dof in Dof])
        if not self._is_used:
            self._is_used, self._command = True, start
            return super().reset()
        before = self._command
        for share in (1 - np.cos(np.linspace(0, np.pi, 100))) / 2:
            sample = self.step(before + share * (start - before))
        return sample

    def step(self, command: ArrayLike) -> Sample:
        """As the twin's."""
        self._command = np.array(command)
        return super().step(command)


def with_truth(folder: Path, suffix: str, truth: Path) -> Recording:
    """A run with the true tip at its ticks and captures, as the in-process twin would have it."""
    recording = Recording.load(folder, suffix)
    sent = read_sent(folder / f"timing_cycles{suffix}.csv")
    instants, states = read_ground_truth(truth)
    trace, frames = recording.trace.copy(), recording.frames.copy()
    count = min(len(sent), len(trace))
    trace = trace[:count]
    for dof in Dof:
        column = np.interp(sent[:count], instants, states[:, dof])
        trace[f"true_{dof.label}"] = column
        frames[f"true_{dof.label}"] = np.interp(
            frames["captured_at"], trace["time"], column, left=np.nan, right=np.nan
        )
    return replace(recording, trace=trace, frames=frames)


def compared(arguments: argparse.Namespace, out: Path | None) -> dict[str, Any]:
    """The protocol on the bench and in the in-process twin."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        config = bench_config(folder, arguments)
        truth, place = folder / "truth.csv", out or folder / "run"
        with rig(config, folder, "--truth", str(truth)):
            text, errors = (process := run(folder / "rig.toml", place, "--compare")).communicate()
        if process.returncode:
            raise RuntimeError(errors)
        pair = [with_truth(place, suffix, truth) for suffix in ("_uncompensated", "")]
        bench = evaluate(*pair)
        replays = {name: _replayed(place / f"{name}.mcap") for name in json.loads(text)["runs"]}
    one = GoingOn(config)
    reference = SineSequence(config.experiment)
    twin = evaluate(*(run_experiment(one, reference, config, kind) for kind in (False, True)))
    document: dict[str, Any] = {"run": json.loads(text)["runs"], "reductions": {}}
    document["replays"] = replays
    for dof in Dof:
        ours, theirs = bench[dof].reduction, twin[dof].reduction
        document["reductions"][dof.label] = {
            "bench": ours,
            "bench_by_camera": bench[dof].reduction_estimate,
            "in_process": theirs,
            "in_process_by_camera": twin[dof].reduction_estimate,
            "holds": bool(abs(ours - theirs) <= WITHIN),
        }
    document["widths"] = {"bench": _widths(bench), "in_process": _widths(twin)}
    return document


def _replayed(log: Path) -> dict[str, Any]:
    """Whether a log gives the same again, bit for bit."""
    found, _ = replay_same(read_log(log))
    return {
        "identical": found.is_identical and not found.ended,
        "ticks": found.ticks,
        "updates": found.updates,
        "said": found.first_difference or found.ended,
    }


def _widths(results: Results) -> dict[str, dict[str, float | None]]:
    names = ("uncompensated", "compensated", "tracking_rms", "state_rms", "frames_used")
    return {
        dof.label: {name: tables.finite_or_none(getattr(found, name)) for name in names}
        for dof, found in results.items()
    }


def faults(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Each fault in a run of its own: the error, what it says, and when the motors were stopped."""
    rows = []
    for what, (request, says) in FAULTS.items():
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            config = bench_config(folder, arguments)
            with rig(config, folder) as found:
                process = run(folder / "rig.toml", folder / "run")
                found.event("operation enabled", "bending")
                time.sleep(4.0)
                found.request(request)
                began = found.event(f"fault: {request.split()[0]}")
                stopped = found.event("quick stop active", "bending")
                _, errors = process.communicate(timeout=PATIENCE)
            row = _row(what, process.returncode, errors, 1e3 * (stopped - began))
            row["limit_ms"] = LIMITS.get(what)
            row["holds"] = _ended_by(row, says) and row["ms"] <= LIMITS.get(what, np.inf)
            rows.append(row)
    rows.append(replugged(arguments))
    return rows


def replugged(arguments: argparse.Namespace) -> dict[str, Any]:
    """A camera that is away for a while: the run goes on."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        config = bench_config(folder, arguments)
        with rig(config, folder) as found:
            process = run(folder / "rig.toml", folder / "run")
            found.event("operation enabled", "bending")
            time.sleep(4.0)
            found.request("fault camera")
            time.sleep(REPLUG)
            found.request("clear camera")
            came, said = time.monotonic(), []
            assert process.stderr is not None
            for line in process.stderr:
                said.append(line)
                if "frames again" in line:
                    break
            took = 1e3 * (time.monotonic() - came)
            process.terminate()
            found.event("quick stop active", "bending")
            process.communicate(timeout=PATIENCE)
        warnings = " / ".join(line.strip() for line in said if line.startswith("warning"))
        return _row(f"camera back after {REPLUG:g} s", None, warnings, took)


def wrong(arguments: argparse.Namespace) -> list[dict[str, Any]]:
    """Each wrong configuration against a right rig; from enabled to stopped, if it moved."""
    rows = []
    for what, (changes, says) in WRONG.items():
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            config = bench_config(folder, arguments)
            file = folder / "wrong.toml"
            file.write_text(dump_config(config.replace(**changes)), encoding="utf-8")
            with rig(config, folder) as found:
                process = run(file, folder / "run")
                _, errors = process.communicate()
                found.request("clear camera")  # so that there is something to read to
                events = found.until("fault: clear")
            enabled = [at for at, what in events if what == "operation enabled"]
            stopped = [at for at, what in events if what == "quick stop active"]
            took = 1e3 * (max(stopped) - min(enabled)) if enabled and stopped else None
            row = _row(what, process.returncode, errors, took)
            rows.append(row | {"holds": _ended_by(row, says)})
    return rows


def _ended_by(row: dict[str, Any], says: str) -> bool:
    return row["status"] == ENDED_BY_ERROR and row["said"].startswith(f"error: {says}")


def _row(what: str, status: int | None, errors: str, took: float | None) -> dict[str, Any]:
    said = [line for line in errors.splitlines() if line.startswith(("error", "warning"))]
    return {"what": what, "status": status, "ms": took, "said": said[-1] if said else errors[-300:]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--minutes", type=float, help="of each run [what the periods take]")
    parser.add_argument("--period", type=float, default=10.0, help="of the sines [s]")
    parser.add_argument("--periods", type=int, default=5, help="per degree of freedom")
    parser.add_argument("--profile", default="paper")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="keep the run's folder here, and bench.json")
    parser.add_argument("--only", choices=["compared", "faults", "wrong"])
    arguments = parser.parse_args()
    if arguments.minutes is not None:
        arguments.periods = round(60 * arguments.minutes / (len(Dof) * arguments.period))
    document: dict[str, Any] = {"cpus": os.cpu_count(), "load": os.getloadavg()}
    if arguments.only in {None, "compared"}:
        document |= compared(arguments, arguments.out)
    if arguments.only in {None, "faults"}:
        document["faults"] = faults(arguments)
    if arguments.only in {None, "wrong"}:
        document["wrong"] = wrong(arguments)
    if arguments.out is not None:
        arguments.out.mkdir(parents=True, exist_ok=True)
        file = arguments.out / "bench.json"
        file.write_text(json.dumps(document, indent=1), encoding="utf-8")
    if arguments.json:
        print(json.dumps(document, indent=1))
        return
    for line in bench_tables.tables(document):
        print(line)


if __name__ == "__main__":
    main()
