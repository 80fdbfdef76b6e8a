"""The article's protocol on the bench, compared with the in-process twin."""

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bench.commissioning import calibrate, check
from bench.processes import bench_config, run, start_rig
from numpy.typing import ArrayLike
from tautscope.bench.ground_truth import read_ground_truth
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

MAX_DIFFERENCE = 0.03
"""Largest difference between the reductions on the bench and of the in-process twin."""


class PersistentTwin(Twin):
    """In-process twin that a second run finds as the first one left it, as on the bench."""

    _is_used = False
    _command: np.ndarray

    def reset(self) -> Sample:
        """Start new at first; later, move slowly to the start position."""
        start = np.array([self.config.experiment[dof].centre for dof in Dof])
        if not self._is_used:
            self._is_used, self._command = True, start
            return super().reset()
        before = self._command
        for share in (1 - np.cos(np.linspace(0, np.pi, 100))) / 2:
            sample = self.step(before + share * (start - before))
        return sample

    def step(self, command: ArrayLike) -> Sample:
        """See `Twin.step`."""
        self._command = np.array(command)
        return super().step(command)


def with_truth(folder: Path, suffix: str, truth: Path) -> Recording:
    """Load a run and add the true tip at its ticks and frames, as the in-process twin does."""
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


def compare(arguments: argparse.Namespace, out: Path | None) -> dict[str, Any]:
    """Commission a rig on the bench, run the protocol on it and in the in-process twin."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        config = bench_config(folder, arguments)
        truth, run_folder = folder / "truth.csv", out or folder / "run"
        with start_rig(config, folder, "--truth", str(truth)):
            file = folder / "rig.toml"
            document: dict[str, Any] = {"missing": check(file)} | calibrate(file, config)
            process = run(file, run_folder, "--compare")
            text, errors = process.communicate()
        if process.returncode:
            raise RuntimeError(errors)
        pair = [with_truth(run_folder, suffix, truth) for suffix in ("_uncompensated", "")]
        bench = evaluate(*pair)
        replays = {name: _replay(run_folder / f"{name}.mcap") for name in json.loads(text)["runs"]}
    rig = PersistentTwin(config)
    reference = SineSequence(config.experiment)
    twin = evaluate(
        *(run_experiment(rig, reference, config, compensate) for compensate in (False, True))
    )
    document |= {"run": json.loads(text)["runs"], "replays": replays, "reductions": {}}
    for dof in Dof:
        ours, theirs = bench[dof].reduction, twin[dof].reduction
        document["reductions"][dof.label] = {
            "bench": ours,
            "bench_by_camera": bench[dof].reduction_estimate,
            "in_process": theirs,
            "in_process_by_camera": twin[dof].reduction_estimate,
            "holds": bool(abs(ours - theirs) <= MAX_DIFFERENCE),
        }
    document["widths"] = {"bench": _widths(bench), "in_process": _widths(twin)}
    return document


def _replay(log: Path) -> dict[str, Any]:
    """Replay a log and return whether the results are identical to the bit."""
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
