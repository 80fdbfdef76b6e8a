"""A twin whose detector says a straight line, and runs of it with faults."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
from tautscope import Sample, Twin, load_config
from tautscope.twin.faults import KINDS, Fault, FaultyRig, FeatureFrame, Target

CONFIG = load_config()
PERIOD = CONFIG.control.period
EVERY = 8
START, DURATION = 0.4, 0.4
SEED = 5
CENTRE = np.array([0.025, 0.0, 0.9])


class SeenTwin(Twin):
    """A twin whose detector says a straight line over time."""

    def __init__(self) -> None:
        super().__init__(CONFIG, images=False)
        self._shown = 0

    def reset(self) -> Sample:
        self._shown = 0
        return self._look(super().reset())

    def step(self, command) -> Sample:
        return self._look(super().step(command))

    def _look(self, sample: Sample) -> Sample:
        self._shown += 1
        if (self._shown - 1) % EVERY:
            return sample
        nothing = np.empty((0, 0, 3), np.uint8)
        truth = line(sample.time)
        frame = FeatureFrame(nothing, sample.time, self._shown, truth, features=truth.copy())
        return replace(sample, frame=frame)


def line(time):
    return np.array([100, 200, 150, 260]) + np.array([40, 10, 35, 5]) * time


def command(time):
    return CENTRE + np.array([0.012, 0.5, 0.3]) * time


def run(*faults, seconds=1.2, seed=SEED, rig=None, twin=None):
    twin = twin or SeenTwin()
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


BARE = run(rig=(twin := SeenTwin()), twin=twin)
ONLY = {kind: [row.name for row in KINDS.values() if row.target is kind] for kind in Target}
