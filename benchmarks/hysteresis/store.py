"""Finished runs of the hysteresis benchmark, stored as files."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import tautscope
from common import features
from common.processes import run_parallel
from hysteresis import simulation
from hysteresis.simulation import Simulation
from tautscope.loop.references import Segment
from tautscope.runs.recording import Recording


class Store:
    """Folder of finished runs; file names depend on the run and on all code that takes part."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        code = hashlib.sha256()
        for module in (features, simulation):
            code.update(Path(module.__file__).read_bytes())
        for file in sorted(Path(tautscope.__file__).parent.rglob("*")):
            if file.suffix in {".py", ".so", ".pyd"}:
                code.update(file.read_bytes())
        self._code = code.digest()

    def simulate(
        self,
        plan: Iterable[Simulation],
        workers: int,
        show_progress: Callable[[float], None],
        scheduler: str | None = None,
    ) -> None:
        """Simulate the runs that are not stored yet, the longest first; see `run_parallel`."""
        files = {self._file(run): run for run in plan}
        jobs = [run for file, run in files.items() if not file.exists()]
        jobs.sort(key=lambda run: -run.work)
        total, done = sum(run.work for run in jobs), 0.0
        if not jobs:
            show_progress(1.0)
            return
        for run, packed in run_parallel(_simulate, jobs, min(workers, len(jobs)), scheduler):
            file = self._file(run)
            part = file.with_suffix(".part.npz")
            part.write_bytes(packed)
            part.replace(file)
            done += run.work
            show_progress(done / total)

    def load(self, run: Simulation) -> Recording:
        """Load a finished run."""
        with np.load(self._file(run)) as tables:
            trace, frames = tables["trace"], tables["frames"]
        segments: Sequence[Segment] = run.reference.segments
        return Recording(trace, frames, run.config, run.compensate, tuple(segments))

    def open(self, runs: Mapping[str, Simulation]) -> Recordings:
        """Return finished runs by name; each is loaded when it is accessed."""
        return Recordings(self, runs)

    def _file(self, run: Simulation) -> Path:
        name = hashlib.sha256(self._code + repr(run).encode()).hexdigest()
        return self._folder / f"{name[:32]}.npz"


class Recordings(Mapping[str, Recording]):
    """Runs of one scenario, profile and seed; see `Store.open`."""

    def __init__(self, store: Store, runs: Mapping[str, Simulation]) -> None:
        self._store = store
        self._runs = runs

    def __getitem__(self, name: str) -> Recording:
        return self._store.load(self._runs[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._runs)

    def __len__(self) -> int:
        return len(self._runs)


def _simulate(run: Simulation) -> bytes:
    """Simulate a run; the worker may have no access to the folder."""
    recording, packed = run.run(), io.BytesIO()
    np.savez_compressed(packed, trace=recording.trace, frames=recording.frames)
    return packed.getvalue()
