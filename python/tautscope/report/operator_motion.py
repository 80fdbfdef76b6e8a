"""Tracking of an operator motion: all DOFs at once, judged by the true tip."""

from __future__ import annotations

from dataclasses import dataclass

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.references import OperatorMotion
from tautscope.report import metrics
from tautscope.report.tracking_bound import tracking_bound
from tautscope.runs.recording import Recording, per_dof

FIRST_SEED = 40
"""Seed of the motion on the twin of seed 0."""
EVALUATED_AFTER = 40.0
"""Time after which a run counts; before it, the loop estimates the offsets [s]."""


@dataclass(frozen=True, slots=True)
class OperatorResult:
    """Figures of one DOF under an operator motion, after the first 40 s [m or rad].

    Attributes:
        uncompensated_rms: RMS of (true tip - reference) without compensation.
        compensated_rms: RMS of (true tip - reference) with compensation.
        reduction: 1 - compensated_rms / uncompensated_rms.
        largest: Largest |true tip - reference| with compensation.
        overspeed: 99.9th percentile of |tip speed| over the peak of |reference speed|.
        creep: Travel of the true tip while every reference rests, with compensation.
        bound: The reduction of the vector law with exact knowledge on ideal plays of the article's
            uncompensated widths (`tautscope.report.tracking_bound`).
    """

    uncompensated_rms: float
    compensated_rms: float
    reduction: float
    largest: float
    overspeed: float
    creep: float
    bound: float


OperatorResults = dict[Dof, OperatorResult]


def operator_motion(config: Config, *, is_disturbed: bool = False) -> OperatorMotion:
    """The operator motion for a twin: with its seed another motion too."""
    seed = FIRST_SEED + config.twin.seed
    return OperatorMotion(config.experiment, seed, is_disturbed=is_disturbed)


def evaluate_operator_motion(uncompensated: Recording, compensated: Recording) -> OperatorResults:
    """The figures of every DOF from two runs of one reference, with and without compensation."""
    time = compensated.trace["time"]
    first = int(time.searchsorted(time[0] + EVALUATED_AFTER))
    references = per_dof(compensated.trace, "reference")
    bounds = tracking_bound(references, compensated.config, first=first)
    free, run, references = (
        uncompensated.trace[first:],
        compensated.trace[first:],
        references[first:],
    )
    results: OperatorResults = {}
    for dof in Dof:
        reference, tip = references[:, dof], run[f"true_{dof.label}"]
        before = metrics.tracking_rms(reference, free[f"true_{dof.label}"])
        after = metrics.tracking_rms(reference, tip)
        results[dof] = OperatorResult(
            uncompensated_rms=before,
            compensated_rms=after,
            reduction=metrics.reduction(before, after),
            largest=metrics.largest_error(reference, tip),
            overspeed=metrics.tip_overspeed(run["time"], reference, tip),
            creep=metrics.creep(references, tip),
            bound=float(bounds[dof]),
        )
    return results
