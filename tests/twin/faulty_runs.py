"""A simulated rig with features on a straight line over time, and runs of it with faults."""

import hashlib
from dataclasses import replace

import numpy as np
from tautscope import Sample, Twin, load_config
from tautscope.twin.faults import KINDS, Fault, FaultyRig, FeatureFrame, Target

CONFIG = load_config()
PERIOD = CONFIG.control.period
TICKS_PER_FRAME = 8
START, DURATION = 0.4, 0.4
SEED = 5
CENTRE = np.array([0.025, 0.0, 0.9])


class FeatureTwin(Twin):
    """A twin without images whose measured features are those of `true_features_at`."""

    def __init__(self) -> None:
        super().__init__(CONFIG, images=False)
        self._samples = 0

    def reset(self) -> Sample:
        self._samples = 0
        return self._with_frame(super().reset())

    def step(self, command) -> Sample:
        return self._with_frame(super().step(command))

    def _with_frame(self, sample: Sample) -> Sample:
        self._samples += 1
        if (self._samples - 1) % TICKS_PER_FRAME:
            return sample
        nothing = np.empty((0, 0, 3), np.uint8)
        truth = true_features_at(sample.time)
        frame = FeatureFrame(nothing, sample.time, self._samples, truth, features=truth.copy())
        return replace(sample, frame=frame)


def true_features_at(time):
    return np.array([100, 200, 150, 260]) + np.array([40, 10, 35, 5]) * time


def command(time):
    return CENTRE + np.array([0.012, 0.5, 0.3]) * time


def run(*faults, seconds=1.2, seed=SEED, rig=None, twin=None):
    twin = twin or FeatureTwin()
    rig = rig or FaultyRig(twin, faults, seed)
    collected = [rig.reset()]
    while twin.time < seconds - 1e-9:
        collected.append(rig.step(command(twin.time)))
    return collected


def frames(collected):
    return [(sample.time, sample.frame) for sample in collected if sample.frame is not None]


def fault(kind, **changes):
    settings = {"start": START, "duration": DURATION} | changes
    return Fault(kind, **settings)


def digest(collected):
    sha = hashlib.sha256()
    for sample in collected:
        sha.update(np.array(sample.time).tobytes() + sample.applied.tobytes())
        sha.update(sample.true_state.tobytes())
        if (frame := sample.frame) is not None:
            sha.update(np.array([frame.captured_at, frame.sequence]).tobytes())
            sha.update(frame.image.tobytes() + frame.true_features.tobytes())
            if isinstance(frame, FeatureFrame):
                sha.update(frame.features.tobytes())
    return sha.hexdigest()


NOMINAL = run(rig=(twin := FeatureTwin()), twin=twin)
KINDS_BY_TARGET = {
    kind: [row.name for row in KINDS.values() if row.target is kind] for kind in Target
}
