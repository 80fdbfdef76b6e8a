"""Tracking of an operator motion: all DOFs at once, judged by the true tip where it is known."""

from dataclasses import dataclass

import numpy as np

from tautscope.config import Config, Sine
from tautscope.dof import NamedDof
from tautscope.errors import ConfigError
from tautscope.loop.references import FASTEST, OperatorMotion
from tautscope.report import metrics
from tautscope.report.rows import figure, rows_of
from tautscope.report.tracking_bound import tracking_bound
from tautscope.runs.recording import Floats, Recording, per_dof

FIRST_SEED = 40
"""Seed of the motion on the twin of seed 0."""
EVALUATED_AFTER = 40.0
"""Time after which a run counts; before it, the loop estimates the offsets [s]."""
AMPLITUDE = 0.3
"""Largest amplitude of another robot's motion about the middle of a range [share of the range]."""


@dataclass(frozen=True, slots=True)
class OperatorResult:
    """Figures of one DOF under an operator motion, from `evaluated_after` on [m or rad].

    The tip is the true one, or where it is not known, on hardware, the estimate at the times of the
    images or measurements that measured the DOF. NaN without an uncompensated run; overspeed and
    creep also without the true tip, because they would measure the sensor's noise. The bound is
    that of `tautscope.report.tracking_bound`, NaN for another robot.
    """

    uncompensated_rms: float = figure(
        "uncompensated tracking error, RMS",
        "Distance of the tip from the reference without compensation.",
    )
    compensated_rms: float = figure(
        "compensated tracking error, RMS",
        "Distance of the tip from the reference with compensation.",
    )
    reduction: float = figure(
        "reduction",
        "Share of the tracking error that compensation removes.",
        "share",
        (0.91, 0.81, 0.81),
    )
    largest: float = figure(
        "largest error",
        "Largest distance of the tip from the reference with compensation.",
        goal=(1.8e-3, 0.38, 0.24),
    )
    overspeed: float = figure(
        "tip overspeed",
        "Largest speed of the tip over that of the reference (99.9th percentile).",
        "number",
        goal=2.0,
    )
    creep: float = figure(
        "creep",
        "Travel of the tip while the operator rests: it should stand still.",
        goal=(0.5e-3, 0.05, 0.01),
    )
    bound: float = figure(
        "bound of the reduction",
        "Reduction of a law that knows tip and slack exactly: no goal, but what could be reached.",
        "share",
    )
    slack: float = figure(
        "slack found", "Width of the slack that the loop has found by the end of the run."
    )


OPERATOR_ROWS = rows_of(OperatorResult)
OperatorResults = dict[NamedDof, OperatorResult]


def operator_motion(config: Config, *, is_disturbed: bool = False) -> OperatorMotion:
    """The operator motion for a twin: with its seed another motion too."""
    seed = FIRST_SEED + config.twin.seed
    return OperatorMotion(config.experiment, seed, is_disturbed=is_disturbed)


def motion_of(config: Config, seed: int, duration: float) -> OperatorMotion:
    """An operator motion in the ranges of the degrees of freedom of any robot.

    It is as wide as its speed allows, so that none is faster than `speed`.

    Raises:
        ConfigError: A degree of freedom has no range.
    """
    if not config.dof:
        return OperatorMotion(config.experiment, seed, duration)
    sines = []
    for index, dof in enumerate(config.dof):
        if dof.range is None:
            raise ConfigError(f"dof[{index}].range", None, "a range, within which the tip moves")
        low, high = dof.range
        amplitude = min(AMPLITUDE * (high - low), dof.largest_speed / FASTEST)
        sines.append(Sine(centre=(low + high) / 2, amplitude=amplitude))
    return OperatorMotion(sines, seed, duration)


def evaluated_after(recording: Recording) -> float:
    """From when on a run is evaluated: after 40 s, or half of a shorter run [s]."""
    return min(EVALUATED_AFTER, _duration(recording) / 2)


def _duration(recording: Recording) -> float:
    time = recording.trace["time"]
    return float(time[-1] - time[0])


def tip_and_reference(recording: Recording, dof: NamedDof) -> tuple[Floats, Floats, Floats]:
    """Times [s, the rig's clock], the tip, true or estimated, and the reference, each (n,)."""
    trace, frames = recording.trace, recording.frames
    truth, reference = trace[f"true_{dof.label}"], trace[f"reference_{dof.label}"]
    if np.isfinite(truth).any():
        return trace["time"], truth, reference
    frames = frames[frames[f"observable_{dof.label}"]]
    time = frames["captured_at"]
    return time, frames[f"estimate_{dof.label}"], np.interp(time, trace["time"], reference)


def evaluate_operator_motion(
    uncompensated: Recording | None, compensated: Recording, *, has_bound: bool = True
) -> OperatorResults:
    """The figures of every DOF from a run with compensation, and one without it if there is one.

    Where one of them ended early, they are compared up to there. The bound, which takes seconds, is
    NaN without `has_bound`.
    """
    run = compensated.trace
    start = evaluated_after(compensated)
    end = min(_duration(each) for each in (uncompensated or compensated, compensated))
    first = int(run["time"].searchsorted(run["time"][0] + start))
    config = compensated.config
    references = per_dof(run, "reference", config.dofs)
    bounds = np.full(len(config.dofs), np.nan)
    if has_bound and not config.dof:
        bounds = tracking_bound(references, config, first=first)
    results: OperatorResults = {}
    for index, dof in enumerate(config.dofs):
        tip = run[f"true_{dof.label}"][first:]
        errors = _tracking_errors(compensated, dof, start)
        before, after = (
            np.nan if each is None else metrics.rms(_tracking_errors(each, dof, start, end))
            for each in (uncompensated, compensated)
        )
        results[dof] = OperatorResult(
            uncompensated_rms=before,
            compensated_rms=metrics.rms(errors),
            reduction=metrics.reduction(before, after),
            largest=metrics.largest_error(np.zeros_like(errors), errors),
            overspeed=metrics.tip_overspeed(run["time"][first:], references[first:, index], tip),
            creep=metrics.creep(references[first:], tip),
            bound=float(bounds[index]),
            slack=float(run[f"delta_plus_{dof.label}"][-1] - run[f"delta_minus_{dof.label}"][-1]),
        )
    return results


def _tracking_errors(
    recording: Recording, dof: NamedDof, start: float, end: float = np.inf
) -> Floats:
    """Tip less reference [m or rad] from `start` to `end` [s after the begin of the run]."""
    time, tip, reference = tip_and_reference(recording, dof)
    elapsed = time - recording.trace["time"][0]
    counts = (elapsed >= start) & (elapsed <= end)
    errors: Floats = tip[counts] - reference[counts]
    return errors
