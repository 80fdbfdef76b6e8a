"""Quantities measured on a recording of the hysteresis benchmark."""

from itertools import pairwise

import numpy as np
from hysteresis.simulation import Floats
from tautscope.dof import Dof
from tautscope.loop.references import Segment
from tautscope.report import metrics
from tautscope.runs.recording import Recording


def segment_of(run: Recording, dof: Dof) -> Segment:
    """Return the segment in which a DOF moves."""
    (segment,) = (each for each in run.segments if each.dof is dof)
    return segment


def period_widths(run: Recording, segment: Segment) -> Floats:
    """Return the mean loop width of each period (periods,): true tip over reference."""
    label = segment.dof.label
    return metrics.period_widths(
        run.trace["time"],
        run.trace[f"reference_{label}"],
        run.trace[f"true_{label}"],
        start=float(run.trace["time"][0]) + segment.start,
        period=segment.period,
        periods=segment.periods,
    )


def uncompensated_width(free: Recording) -> float:
    """Return the mean loop width of insertion without compensation, after the first period [m]."""
    (segment,) = free.segments
    rows = free.trace[free.during(segment, 1, segment.periods)]
    return metrics.loop_width(rows["command_insertion"], rows["true_insertion"]).mean


def stroke_widths(run: Recording, first: float, last: float) -> list[float]:
    """Return the mean estimated slack of insertion in each stroke between two periods [m]."""
    (segment,) = run.segments
    trace = run.trace
    turns = trace["time"].searchsorted(np.arange(first, last, 0.5) * segment.period)
    estimate = trace["delta_plus_insertion"] - trace["delta_minus_insertion"]
    return [float(estimate[a:b].mean()) for a, b in pairwise(turns)]
