"""An operator's motion on the simulated colonoscope, and the delay of its tracker."""

from __future__ import annotations

from tautscope.calibration.robot import fit, move
from tautscope.config import load_config
from tautscope.report.operator_motion import evaluate_operator_motion, motion_of
from tautscope.runs.experiment import run_experiment
from tautscope.twin.colonoscope import ColonoscopeTwin

DELAY, UNTOLD = 0.05, 0.1
"""Delay of the tracker, which it tells, and one that it does not tell [s]."""
Job = tuple[str, int]
"""What is measured, "motion" or "delay", and the seed of instrument and motion."""


def simulate(job: Job) -> list[float]:
    """Reduction of the RMS tracking error of each degree of freedom, or the delay found [s]."""
    what, seed = job
    config = load_config("colonoscope")
    if what == "motion":
        motion = motion_of(config, seed, 120.0)
        runs = [
            run_experiment(ColonoscopeTwin(seed, delay=DELAY), motion, config, compensate)
            for compensate in (False, True)
        ]
        return [result.reduction for result in evaluate_operator_motion(*runs).values()]
    rig = ColonoscopeTwin(seed, delay=UNTOLD, told_delay=0.0)
    passage = move(rig, motion_of(config, seed, 60.0), config)
    rig.close()
    return [fit(passage, config, ["kinematics"]).values["measurement.delays[0]"]]
