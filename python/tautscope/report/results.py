"""Table 1 of a run: the figures of merit per DOF; their median and worst value over seeds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from tautscope.config import LawConfig
from tautscope.dof import NamedDof
from tautscope.loop.references import Segment
from tautscope.report import metrics
from tautscope.report.rows import figure, rows_of
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
    ("by camera"). NaN if the true tip is not known, or without an uncompensated run. Tracking
    errors begin after the start, by camera with the segment where the true tip is not known; marker
    error, frames used and speeds are of the segment, the state error of the whole run.
    """

    uncompensated: float = figure(
        "uncompensated width",
        "Slack: how far the command moves after a reversal before the tip does. Mean width of the "
        "loop of the tip over the command, without compensation.",
    )
    uncompensated_max: float = figure(
        "uncompensated width, largest", "The same loop where it is widest."
    )
    compensated: float = figure(
        "compensated width",
        "What is left of the slack for the operator: mean width of the loop of the tip over the "
        "reference, with compensation. 0 is ideal; a negative width means that the tip leads.",
    )
    compensated_max: float = figure("compensated width, largest", "This loop where it is widest.")
    reduction: float = figure(
        "reduction",
        "Share of the mean width that compensation removes: 1 - |compensated| / uncompensated.",
        "share",
        (0.98, 0.96, 0.95),
    )
    reduction_max: float = figure(
        "reduction of the largest width",
        "The same share of the largest widths.",
        "share",
        (0.92, 0.88, 0.87),
    )
    uncompensated_estimate: float = figure(
        "uncompensated width, by camera",
        "The uncompensated width with the tip as the camera measures it, like the article's.",
    )
    compensated_estimate: float = figure(
        "compensated width, by camera",
        "The compensated width with the tip as the camera measures it.",
    )
    reduction_estimate: float = figure(
        "reduction, by camera", "The reduction of the two widths by camera.", "share"
    )
    start_periods: float = figure(
        "periods until settled",
        "Periods of the sine until the compensated width stays within 1.2 times its last value: "
        "how long the slack takes to be estimated.",
        "count",
        goal=1.0,
    )
    tracking_rms: float = figure(
        "tracking error, RMS", "Distance of the tip from the reference, once settled."
    )
    tracking_estimate: float = figure(
        "tracking error, RMS, by camera",
        "The tracking error with the tip as the camera measures it.",
    )
    state_rms: float = figure(
        "state error, RMS", "Error of the loop's estimate of the tip at the time of each image."
    )
    marker_rms_px: float = figure(
        "marker error, RMS [px]",
        "Distance of a band's measured position in the image from its true one.",
        "number",
    )
    frames_used: float = figure(
        "frames used",
        "Share of the images that determined this degree of freedom. A straight instrument does "
        "not show its rotation.",
        "share",
    )
    tip_overspeed: float = figure(
        "tip overspeed",
        "Largest speed of the tip over that of the reference (99.9th percentile). A tip that jumps "
        "has a large value; 1 is ideal.",
        "number",
        goal=2.0,
    )
    actuator_gain: float = figure(
        "actuator gain",
        "Largest step of the command over that of the reference: how hard the motor works while it "
        "crosses the slack.",
        "number",
        goal=LawConfig().free_gain,
    )


ROWS = rows_of(DofResult)
Results = dict[NamedDof, DofResult]


def evaluate(uncompensated: Recording | None, compensated: Recording) -> Results:
    """The figures of every DOF with a segment.

    The uncompensated run is optional, and so is a DOF's segment in it.
    """
    return {
        each.dof: _dof_result(each, uncompensated, compensated) for each in compensated.segments
    }


def combine(
    results: Sequence[dict[NamedDof, Figures]], how: Literal["median", "worst"]
) -> dict[NamedDof, Figures]:
    """Median or worst value of every figure over seeds; unknown ones are skipped.

    The worst width is the one farthest from 0, which is negative where the tip leads.
    """
    combined = {}
    for dof, figures in results[0].items():
        values = {}
        for row in rows_of(type(figures)):
            found = [getattr(result[dof], row.name) for result in results]
            known = [value for value in found if not np.isnan(value)]
            if how == "median":
                value = np.median(known) if known else np.nan
            elif row.worst == "max":
                value = max(known, key=abs, default=np.nan)
            else:
                value = min(known, default=np.nan)
            values[row.name] = float(value)
        combined[dof] = replace(figures, **values)
    return combined


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
    if uncompensated is not None and segment.dof in {each.dof for each in uncompensated.segments}:
        before = metrics.loop_width(*true_loop(uncompensated, segment, "command"))
        before_estimate = metrics.loop_width(*estimated_loop(uncompensated, segment, "command"))
    after = metrics.loop_width(*true_loop(compensated, segment, "reference"))
    after_estimate = metrics.loop_width(*estimated_loop(compensated, segment, "reference"))

    rows = compensated.trace[compensated.during(segment, 0, segment.periods)]
    time, reference, truth = rows["time"], rows[f"reference_{label}"], rows[f"true_{label}"]
    first = float(compensated.trace["time"][0]) + segment.start
    widths = metrics.period_widths(
        time, reference, truth, start=first, period=segment.period, periods=segment.periods
    )
    start = metrics.start_periods(widths)
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
