"""The runs behind the hysteresis benchmark: plain descriptions, simulated once, kept as files."""

from __future__ import annotations

import hashlib
import multiprocessing
import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
import tautscope
from numpy.typing import ArrayLike, NDArray
from tautscope.config import Config, ExperimentConfig
from tautscope.dof import Dof
from tautscope.loop.construction import build_feature_model
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import Segment, SineSequence
from tautscope.loop.rig import Frame, Sample
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording
from tautscope.twin.fault_frames import FeatureFrame

Floats = NDArray[np.float64]

NO_IMAGE = np.empty((0, 0, 3), np.uint8)
NOISE = 0.2
"""Of the true features that stand in for images [px]."""


@dataclass(frozen=True)
class Sines:
    """A sine on some DOFs at once, the others at their centres; a `Reference`.

    Attributes:
        experiment: Centres and amplitudes.
        periods: Per DOF that moves, its period [s].
        duration: [s].
        tremor: Amplitude of a sine of `tremor_frequency` on insertion [m].
        rest_at: When the hand stops; the tremor goes on [s].
        tremor_frequency: [Hz].
    """

    experiment: ExperimentConfig
    periods: tuple[tuple[Dof, float], ...]
    duration: float
    tremor: float = 0.0
    rest_at: float = np.inf
    tremor_frequency: float = 10.0

    @property
    def segments(self) -> tuple[Segment, ...]:
        """Per DOF its whole periods, the last ending with the reference."""
        found = []
        for dof, period in self.periods:
            whole = int(self.duration / period + 1e-9)
            found.append(Segment(dof, self.duration - whole * period, period, whole))
        return tuple(found)

    def __call__(self, time: float) -> Floats:
        """(3,) [m, rad, rad]."""
        position = np.array([self.experiment[dof].centre for dof in Dof])
        for dof, period in self.periods:
            phase = 2 * np.pi * min(time, self.rest_at) / period
            position[dof] += self.experiment[dof].amplitude * np.sin(phase)
        shake = np.sin(2 * np.pi * self.tremor_frequency * time)
        position[Dof.INSERTION] += self.tremor * shake
        return position


@dataclass(frozen=True)
class Simulation:
    """Everything that decides a run.

    Attributes:
        config: Of loop and twin.
        motion: What the hand does; None is the article's protocol.
        compensate: Without it the command is the reference and no image is drawn.
        bends: (time [s], bends of the scope) with straight lines between; empty leaves them.
        images: False puts true features with `NOISE` in the place of images.
    """

    config: Config
    motion: Sines | None = None
    compensate: bool = True
    bends: tuple[tuple[float, float], ...] = ()
    images: bool = True

    @property
    def reference(self) -> Sines | SineSequence:
        """The motion itself."""
        return self.motion or SineSequence(self.config.experiment)

    @property
    def work(self) -> float:
        """Rough share of the time all runs take."""
        return self.reference.duration * (1.0 if self.compensate and self.images else 0.2)

    def run(self) -> Recording:
        """Simulate it."""
        rig = BenchTwin(self)
        try:
            return run_experiment(
                rig,
                self.reference,
                self.config,
                self.compensate,
                look=HysteresisReduction.on_frame if self.images else take_features,
            )
        finally:
            rig.close()


def uncompensated(config: Config, motion: Sines | None = None) -> Simulation:
    """The same instrument without compensation, whatever the loop is: shared by all loops."""
    plain, twin = Config(), Config().twin
    twin = msgspec.structs.replace(
        config.twin, disturb=(), latency=twin.latency, latency_jitter=twin.latency_jitter
    )
    bare = msgspec.structs.replace(
        plain,
        control=config.control,
        experiment=config.experiment,
        instrument=config.instrument,
        camera=config.camera,
        twin=twin,
    )
    return Simulation(bare, motion, compensate=False)


class BenchTwin:
    """The twin, with a scope that bends during the run and features in the place of images."""

    def __init__(self, simulation: Simulation) -> None:
        # The plan is read by processes that simulate nothing.
        from tautscope.twin import Twin  # noqa: PLC0415

        config = simulation.config
        self._knots = np.array(simulation.bends).reshape(-1, 2)
        self._twin = Twin(config, images=simulation.compensate and simulation.images)
        blind = simulation.compensate and not simulation.images
        self._features = FeatureCamera(config) if blind else None
        self._time = 0.0

    @property
    def control_period(self) -> float:
        """[s]."""
        return self._twin.control_period

    def reset(self) -> Sample:
        """As `Twin.reset`."""
        return self._look(self._twin.reset())

    def step(self, command: ArrayLike) -> Sample:
        """As `Twin.step`."""
        if len(self._knots):
            bends = float(np.interp(self._time, *self._knots.T))
            if bends != self._twin.bends:
                self._twin.bends = bends
        return self._look(self._twin.step(command))

    def close(self) -> None:
        """As `Twin.close`."""
        self._twin.close()

    def _look(self, sample: Sample) -> Sample:
        self._time = sample.time
        if self._features is None:
            return sample
        return replace(sample, frame=self._features.look(sample))


class FeatureCamera:
    """True features by the loop's own model, noise on top, at the camera's rate and delay."""

    def __init__(self, config: Config) -> None:
        self._twin = config.twin
        self.model = build_feature_model(config)
        self._noise = np.random.default_rng([config.twin.seed, 1])
        self._every = round(1 / (config.twin.frame_rate * config.control.period))
        self._tick = 0
        self._pending: deque[Frame] = deque()

    def look(self, sample: Sample) -> Frame | None:
        """The frame that arrives with a sample, if any."""
        if self._tick % self._every == 0 and sample.true_state is not None:
            seen = self.model.predict(sample.true_state)
            if seen is not None:
                noisy = seen[0] + NOISE * self._noise.standard_normal(4)
                self._pending.append(
                    FeatureFrame(NO_IMAGE, sample.time, self._tick, seen[0], features=noisy)
                )
        self._tick += 1
        late = self._twin.latency - 1e-9
        if self._pending and sample.time >= self._pending[0].captured_at + late:
            return self._pending.popleft()
        return None


def take_features(loop: HysteresisReduction, frame: Frame) -> Report:
    """What the loop does with the features that stand in for an image."""
    assert isinstance(frame, FeatureFrame)
    return loop.on_features(frame.features, frame.captured_at)


class Store:
    """Finished runs in a folder, under a name that changes with whatever could change them."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        code = hashlib.sha256(Path(__file__).read_bytes())
        package = Path(tautscope.__file__).parent
        for file in sorted(package.rglob("*")):
            if file.suffix in {".py", ".so", ".pyd"}:
                code.update(file.read_bytes())
        self._code = code.digest()

    def simulate(
        self, plan: Iterable[Simulation], workers: int, tell: Callable[[float], None]
    ) -> None:
        """Run what is not there yet, the longest first; `tell` is given the share done."""
        files = {self._file(each): each for each in plan}
        todo = [each for file, each in files.items() if not file.exists()]
        todo.sort(key=lambda each: -each.work)
        total, done = sum(each.work for each in todo), 0.0
        if not todo:
            tell(1.0)
            return
        with ProcessPoolExecutor(
            min(workers, len(todo)),
            mp_context=multiprocessing.get_context("spawn"),
            initializer=one_thread,
        ) as pool:
            running = {pool.submit(_simulate, each, self._file(each)): each for each in todo}
            try:
                for finished in as_completed(running):
                    finished.result()
                    done += running[finished].work
                    tell(done / total)
            except BaseException:
                pool.shutdown(cancel_futures=True)
                raise

    def load(self, simulation: Simulation) -> Recording:
        """A finished run."""
        with np.load(self._file(simulation)) as tables:
            trace, frames = tables["trace"], tables["frames"]
        segments: Sequence[Segment] = simulation.reference.segments
        return Recording(trace, frames, simulation.config, simulation.compensate, tuple(segments))

    def open(self, runs: Mapping[str, Simulation]) -> Recordings:
        """Finished runs by name, each loaded when it is asked for."""
        return Recordings(self, runs)

    def _file(self, simulation: Simulation) -> Path:
        name = hashlib.sha256(self._code + repr(simulation).encode()).hexdigest()
        return self._folder / f"{name[:32]}.npz"


class Recordings(Mapping[str, Recording]):
    """The runs of one group, profile and seed; see `Store.open`."""

    def __init__(self, store: Store, runs: Mapping[str, Simulation]) -> None:
        self._store = store
        self._runs = runs

    def __getitem__(self, name: str) -> Recording:
        return self._store.load(self._runs[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._runs)

    def __len__(self) -> int:
        return len(self._runs)


def one_thread() -> None:
    """So that as many processes as cores do not get into each other's way."""
    os.environ["OMP_NUM_THREADS"] = "1"
    import cv2  # noqa: PLC0415  the parent draws no pictures

    cv2.setNumThreads(1)


def _simulate(simulation: Simulation, file: Path) -> None:
    recording = simulation.run()
    part = file.with_suffix(".part.npz")
    np.savez_compressed(part, trace=recording.trace, frames=recording.frames)
    part.replace(file)
