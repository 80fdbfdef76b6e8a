"""Goals of the loop that are measured by repetition: stalls and identical runs."""

from __future__ import annotations

import hashlib

import numpy as np
from common.features import update_from_features
from faults.operator_input import OperatorInput
from faults.rigs import FeatureTwin
from faults.scenarios import build_config
from guarantees.measurement import Measurement
from tautscope import HysteresisReduction, load_config
from tautscope.dof import Dof
from tautscope.runs.experiment import run_experiment


def stalls(count: int) -> Measurement:
    """Measure G14: the step of the command after the loop was not called while the input moved."""
    config = load_config(profile="best")
    period, rng = config.control.period, np.random.default_rng(14)
    speed = config.safety.command_speed[0]
    worst, failures = 0.0, 0
    loop, time, last = HysteresisReduction(config), 0.0, 0.0
    for stall in range(count):
        if stall % 50 == 0:
            loop, time = HysteresisReduction(config), float(rng.uniform(0, 8))
        for tick in range(20):
            time += period if tick else float(rng.uniform(0.005, 2.0))
            motion = 15e-3 * np.sin(2 * np.pi * time / 7.5)
            command = float(loop.step([0.025 + motion, 0.0, 0.9], time)[0])
            step = abs(command - last) if stall % 50 or tick else 0.0
            worst, failures = max(worst, step), failures + (step > speed * period * (1 + 1e-9))
            last = command
        loop.engage()
    text = f"{1e3 * worst:.3f} mm, v_max dt = {1e3 * speed * period:.3f} mm"
    return Measurement(text, str(count), failures, "14")


def replays(count: int) -> Measurement:
    """Measure G19: whether repetitions of a run are identical."""
    digests = {_run_digest() for _ in range(count)}
    return Measurement(f"{len(digests)} kind(s) of bytes", str(count), len(digests) - 1, "19")


def _run_digest() -> str:
    config = build_config(19, "best", ())
    twin = FeatureTwin(config)
    motion = OperatorInput(config, dict.fromkeys(Dof, 3.0), lambda: twin.time, 2.0)
    recording = run_experiment(twin, motion, config, look=update_from_features)
    return hashlib.sha256(recording.trace.tobytes() + recording.frames.tobytes()).hexdigest()
