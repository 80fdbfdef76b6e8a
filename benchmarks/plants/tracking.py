"""Tracking error and estimates of a simulated instrument."""

from dataclasses import dataclass

from common.features import update_from_features
from plants.simulated import PlantRig
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import OperatorMotion
from tautscope.loop.rig import Frame
from tautscope.report import metrics
from tautscope.report.operator_motion import EVALUATED_AFTER
from tautscope.runs.experiment import run_experiment

Job = tuple[str, int]
"""Plant and seed."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """Figures of a plant and seed; lists are per DOF.

    Attributes:
        reductions: Reduction of the RMS tracking error after the first 40 s.
        gains: Estimated gains at the end of the compensated run.
        shared: Estimated share of the friction that insertion and rotation have in common, then.
    """

    reductions: list[float]
    gains: list[float]
    shared: float


def simulate(job: Job) -> Outcome:
    """Run a plant without and with compensation."""
    plant, seed = job
    config = load_config(profile="best").replace(**{"twin.seed": seed})
    motion = OperatorMotion(config.experiment, seed)
    errors = []
    estimate = None

    def look(loop: HysteresisReduction, frame: Frame) -> Report:
        nonlocal estimate
        report = update_from_features(loop, frame)
        estimate = loop.hysteresis
        return report

    for compensate in (False, True):
        rig = PlantRig(config, plant)
        trace = run_experiment(rig, motion, config, compensate, look=look).trace
        late = trace[trace["time"] >= trace["time"][0] + EVALUATED_AFTER]
        names = [dof.label for dof in Dof]
        errors.append(
            [metrics.tracking_rms(late[f"reference_{n}"], late[f"true_{n}"]) for n in names]
        )
    assert estimate is not None
    reductions = [metrics.reduction(*pair) for pair in zip(*errors, strict=True)]
    return Outcome(reductions, estimate.gain.tolist(), estimate.shared)
