"""Tracking error of a simulated instrument with and without compensation."""

from __future__ import annotations

from common.features import update_from_features
from plants.simulated import PlantRig
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.loop.references import OperatorMotion
from tautscope.report import metrics
from tautscope.report.operator_motion import EVALUATED_AFTER
from tautscope.runs.experiment import run_experiment

Job = tuple[str, int]
"""Plant and seed."""


def reductions(job: Job) -> list[float]:
    """Reduction of the RMS tracking error per DOF after the first 40 s."""
    plant, seed = job
    config = load_config(profile="best").replace(**{"twin.seed": seed})
    motion = OperatorMotion(config.experiment, seed)
    errors = []
    for compensate in (False, True):
        rig = PlantRig(config, plant)
        trace = run_experiment(rig, motion, config, compensate, look=update_from_features).trace
        late = trace[trace["time"] >= trace["time"][0] + EVALUATED_AFTER]
        names = [dof.label for dof in Dof]
        errors.append(
            [metrics.tracking_rms(late[f"reference_{n}"], late[f"true_{n}"]) for n in names]
        )
    return [metrics.reduction(*pair) for pair in zip(*errors, strict=True)]
