"""Simulated runs of the hysteresis benchmark."""

from dataclasses import dataclass, replace

import msgspec
import numpy as np
from common.features import FeatureCamera, update_from_features
from numpy.typing import ArrayLike, NDArray
from tautscope.config import Config, ExperimentConfig
from tautscope.dof import Dof
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.references import OperatorMotion, Segment, SineSequence
from tautscope.loop.rig import Sample
from tautscope.runs.experiment import run_experiment
from tautscope.runs.recording import Recording
from tautscope.twin import Twin

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Sines:
    """Sines on some DOFs at once, the others at their centres; implements `Reference`.

    Attributes:
        experiment: Centres and amplitudes.
        periods: Period of each DOF that moves [s].
        duration: Duration [s].
        tremor: Amplitude of the tremor of insertion [m].
        rest_at: When the intended motion stops; the tremor continues [s].
        tremor_frequency: Frequency of the tremor [Hz].
    """

    experiment: ExperimentConfig
    periods: tuple[tuple[Dof, float], ...]
    duration: float
    tremor: float = 0.0
    rest_at: float = np.inf
    tremor_frequency: float = 10.0

    @property
    def segments(self) -> tuple[Segment, ...]:
        """Whole periods of each DOF; the last one ends with the reference."""
        found = []
        for dof, period in self.periods:
            whole = int(self.duration / period + 1e-9)
            found.append(Segment(dof, self.duration - whole * period, period, whole))
        return tuple(found)

    def __call__(self, time: float) -> Floats:
        """Return the reference (3,) [m, rad, rad]."""
        position = np.array([self.experiment[dof].centre for dof in Dof])
        for dof, period in self.periods:
            phase = 2 * np.pi * min(time, self.rest_at) / period
            position[dof] += self.experiment[dof].amplitude * np.sin(phase)
        # It grows over its first periods: a start at full speed is a jump, which stops motion.
        growth = min(0.2 * self.tremor_frequency * time, 1.0)
        oscillation = growth * np.sin(2 * np.pi * self.tremor_frequency * time)
        position[Dof.INSERTION] += self.tremor * oscillation
        return position


Motion = Sines | OperatorMotion


@dataclass(frozen=True)
class Simulation:
    """Complete description of a run.

    Attributes:
        config: Configuration of loop and twin.
        motion: Reference; None is the article's protocol.
        compensate: Whether the loop runs; if not, the command is the reference, without images.
        bends: (time [s], bends of the endoscope), linear in between; empty for constant bends.
        images: Whether images are rendered; if not, a `FeatureCamera` replaces them.
    """

    config: Config
    motion: Motion | None = None
    compensate: bool = True
    bends: tuple[tuple[float, float], ...] = ()
    images: bool = True

    @property
    def reference(self) -> Motion | SineSequence:
        """Reference of the run."""
        return self.motion or SineSequence(self.config.experiment)

    @property
    def work(self) -> float:
        """Rough relative computing time."""
        return self.reference.duration * (1.0 if self.compensate and self.images else 0.2)

    def run(self) -> Recording:
        """Simulate the run."""
        rig = BenchTwin(self)
        try:
            return run_experiment(
                rig,
                self.reference,
                self.config,
                self.compensate,
                look=HysteresisReduction.on_frame if self.images else update_from_features,
            )
        finally:
            rig.close()


def uncompensated(config: Config, motion: Motion | None = None) -> Simulation:
    """Describe a run of the same instrument without compensation, shared by all configurations."""
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


class BenchTwin(Twin):
    """Twin whose endoscope bends during the run; optionally with features instead of images."""

    def __init__(self, run: Simulation) -> None:
        super().__init__(run.config, images=run.compensate and run.images)
        needs_features = run.compensate and not run.images
        self._feature_camera = FeatureCamera(run.config) if needs_features else None
        self._knots = np.array(run.bends).reshape(-1, 2)
        self._time_of_sample = 0.0

    def reset(self) -> Sample:
        """See `Twin.reset`."""
        return self._with_frame(super().reset())

    def step(self, command: ArrayLike) -> Sample:
        """See `Twin.step`."""
        if len(self._knots):
            bends = float(np.interp(self._time_of_sample, *self._knots.T))
            if bends != self.bends:
                self.bends = bends
        return self._with_frame(super().step(command))

    def _with_frame(self, sample: Sample) -> Sample:
        self._time_of_sample = sample.time
        if self._feature_camera is None:
            return sample
        return replace(sample, frame=self._feature_camera.capture(sample))
