"""Table 1 of a run: the figures of merit per DOF; their median and worst value over seeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from tautscope.dof import NamedDof
from tautscope.loop.references import Segment
from tautscope.report import metrics
from tautscope.runs.recording import Recording, Table, per_feature

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Figures = TypeVar("Figures", bound="DataclassInstance")
"""A dataclass of figures of merit of one DOF."""

LAST_PERIODS = 2
"""Number of periods at the end of a segment over which loop widths are measured."""


@dataclass(frozen=True, slots=True)
class DofResult:
    """Figures of one DOF from a run with compensation and one without [m or rad].

    Widths are of y over x in the last two periods of the DOF's segment: x is the command without
    and the reference with compensation; y is the true tip, or the estimate where the name says so
    ("by camera"). NaN if the true tip is not known, or without an uncompensated run.

    Attributes:
        uncompensated: Mean width without compensation.
        uncompensated_max: Largest width without compensation.
        compensated: Mean width with compensation.
        compensated_max: Largest width with compensation.
        reduction: 1 - compensated / uncompensated, of the mean widths.
        reduction_max: 1 - compensated_max / uncompensated_max.
        uncompensated_estimate: Mean width without compensation, by camera.
        compensated_estimate: Mean width with compensation, by camera.
        reduction_estimate: Reduction by camera; this is the article's.
        start_periods: Periods until the compensated mean width stays within 1.2 times its last.
        tracking_rms: RMS of (true tip - reference) after the start, with compensation.
        tracking_estimate: RMS of (estimate - reference) after the start, by camera; over the whole
            segment if the true tip, and so the start, is not known.
        state_rms: RMS of (state_estimate - true_state at the capture time) over all frames of the
            whole compensated run that measured this DOF.
        marker_rms_px: RMS distance of measured from true features in the DOF's segment [px].
        frames_used: Share of the segment's frames that measured this DOF.
        tip_overspeed: 99.9th percentile of |tip speed| over the peak of |reference speed|.
        actuator_gain: Largest |change of command| over |change of reference|.
    """

    uncompensated: float
    uncompensated_max: float
    compensated: float
    compensated_max: float
    reduction: float
    reduction_max: float
    uncompensated_estimate: float
    compensated_estimate: float
    reduction_estimate: float
    start_periods: float
    tracking_rms: float
    tracking_estimate: float
    state_rms: float
    marker_rms_px: float
    frames_used: float
    tip_overspeed: float
    actuator_gain: float


Results = dict[NamedDof, DofResult]


def evaluate(uncompensated: Recording | None, compensated: Recording) -> Results:
    """The figures of every DOF with a segment; the uncompensated run is optional."""
    return {
        segment.dof: _dof_result(segment, uncompensated, compensated)
        for segment in compensated.segments
    }


def evaluate_uncompensated(recording: Recording) -> Results:
    """The figures of every DOF with a segment, from a run without compensation.

    Those of compensation are NaN.
    """
    unknown = {
        field.name: np.nan
        for field in fields(DofResult)
        if field.name.startswith(("compensated", "reduction", "start"))
    }
    found = evaluate(recording, recording)
    return {dof: replace(result, **unknown) for dof, result in found.items()}


def combine(
    results: Sequence[dict[NamedDof, Figures]], how: dict[str, str] | str
) -> dict[NamedDof, Figures]:
    """Combine seeds: ``"median"``, or per name of a figure ``"min"``, ``"max"`` or ``"median"``.

    Seeds with an unknown figure are skipped.
    """
    return {
        dof: replace(
            figures,
            **{
                field.name: _combined(
                    [getattr(result[dof], field.name) for result in results],
                    how if isinstance(how, str) else how[field.name],
                )
                for field in fields(figures)
            },
        )
        for dof, figures in results[0].items()
    }


def _combined(values: list[float], how: str) -> float:
    known = [value for value in values if not np.isnan(value)]
    if not known:
        return np.nan
    if how == "median":
        return float(np.median(known))
    return max(known) if how == "max" else min(known)


def true_loop(
    recording: Recording, segment: Segment, x: str, first: float | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """X (``"command"`` or ``"reference"``) and the true tip, from period `first` of a segment.

    By default from the last but one.
    """
    begin = segment.periods - LAST_PERIODS if first is None else first
    rows = recording.during(segment, begin, segment.periods)
    label = segment.dof.label
    return recording.trace[f"{x}_{label}"][rows], recording.trace[f"true_{label}"][rows]


def estimated_loop(
    recording: Recording, segment: Segment, x: str, first: float | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """X and the estimate at the capture times of the frames that measured the DOF.

    From period `first` of the segment, by default from the last but one, to its end.
    """
    begin = segment.periods - LAST_PERIODS if first is None else first
    frames = used_frames(recording, segment, begin)
    label, trace = segment.dof.label, recording.trace
    at_capture = np.interp(frames["captured_at"], trace["time"], trace[f"{x}_{label}"])
    return at_capture, frames[f"estimate_{label}"]


def used_frames(recording: Recording, segment: Segment, first: float = 0) -> Table:
    """The frames that measured a segment's DOF, from its period `first` to its end."""
    inside = recording.frames_during(segment, first, segment.periods)
    frames: Table = recording.frames[inside & recording.frames[f"observable_{segment.dof.label}"]]
    return frames


def _dof_result(
    segment: Segment, uncompensated: Recording | None, compensated: Recording
) -> DofResult:
    label = segment.dof.label
    before = before_estimate = metrics.loop_width([], [])
    if uncompensated is not None:
        before = metrics.loop_width(*true_loop(uncompensated, segment, "command"))
        before_estimate = metrics.loop_width(*estimated_loop(uncompensated, segment, "command"))
    after = metrics.loop_width(*true_loop(compensated, segment, "reference"))
    after_estimate = metrics.loop_width(*estimated_loop(compensated, segment, "reference"))

    rows = compensated.trace[compensated.during(segment, 0, segment.periods)]
    time, reference, truth = rows["time"], rows[f"reference_{label}"], rows[f"true_{label}"]
    start = metrics.start_periods(
        metrics.period_widths(
            time,
            reference,
            truth,
            start=float(compensated.trace["time"][0]) + segment.start,
            period=segment.period,
            periods=segment.periods,
        )
    )
    begin = float(np.nan_to_num(start))
    settled = compensated.trace[compensated.during(segment, begin, segment.periods)]
    frames = compensated.frames[compensated.frames[f"observable_{label}"]]
    own_used = used_frames(compensated, segment)
    own_count = int(compensated.frames_during(segment, 0, segment.periods).sum())
    return DofResult(
        uncompensated=before.mean,
        uncompensated_max=before.max,
        compensated=after.mean,
        compensated_max=after.max,
        reduction=metrics.reduction(before.mean, after.mean),
        reduction_max=metrics.reduction(before.max, after.max),
        uncompensated_estimate=before_estimate.mean,
        compensated_estimate=after_estimate.mean,
        reduction_estimate=metrics.reduction(before_estimate.mean, after_estimate.mean),
        start_periods=start,
        tracking_rms=metrics.tracking_rms(settled[f"reference_{label}"], settled[f"true_{label}"]),
        tracking_estimate=metrics.tracking_rms(
            *estimated_loop(compensated, segment, "reference", begin)
        ),
        state_rms=metrics.state_rms(frames[f"estimate_{label}"], frames[f"true_{label}"]),
        marker_rms_px=metrics.marker_rms(
            per_feature(own_used, "features"), per_feature(own_used, "true_features")
        ),
        frames_used=len(own_used) / own_count if own_count else np.nan,
        tip_overspeed=metrics.tip_overspeed(time, reference, truth),
        actuator_gain=metrics.actuator_gain(reference, rows[f"command_{label}"]),
    )
