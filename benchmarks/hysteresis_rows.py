"""The rows of the hysteresis benchmark: which runs each needs, and its figures from them.

A `Scenario` is plain data: a name, the runs of one configuration, and a function from their
recordings to figures.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from hysteresis_goals import CONDITIONS, LATENCIES
from hysteresis_runs import Floats, Recordings, Simulation, Sines, uncompensated
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.references import Segment
from tautscope.report import metrics
from tautscope.report.results import evaluate
from tautscope.runs.recording import Recording, Table

Plan = dict[str, Simulation]
Found = list[tuple[str, Dof, float]]
"""What, DOF, figure; in metres or radians or as a share."""

NOMINAL = 10e-3
"""Uncompensated width of insertion: the article's Table 1, to which the twin is set [m]."""
INCOMMENSURATE = ((Dof.INSERTION, 10.0), (Dof.ROTATION, 7.3), (Dof.BENDING, 8.9))
TOGETHER = 60.0
STRAIGHT = (3, 4, 7, 8)
"""The scope straightens between the first two of these periods and bends between the others."""
CHANGING_PERIODS = 11
WIDE_PERIODS = 4
GONE = 0.05
"""An overshoot below this share of the uncompensated width is gone: as much as may be left."""
TREMOR = 1e-3
"""Amplitude: 2 mm peak to peak [m]."""
RESTS = (0.0, 1e-3, 2e-3)
"""How far beyond its reversal the hand stops [m]."""
REST_AFTER, REST_FOR = 20.0, 5.0
"""The hand stops at the reversal that follows this time, for so long [s]."""


@dataclass(frozen=True)
class Scenario:
    """One group of rows.

    Attributes:
        plan: The runs of a configuration, by name.
        figures: From their recordings.
        profiles: For which it is measured.
    """

    plan: Callable[[Config], Plan]
    figures: Callable[[Recordings], Found]
    profiles: tuple[str, ...] = ("paper", "best")


def alone_plan(config: Config) -> Plan:
    return {"free": uncompensated(config), "run": Simulation(config)}


def alone(recordings: Recordings) -> Found:
    """The article's protocol."""
    free, run = recordings["free"], recordings["run"]
    found: Found = []
    for dof, result in evaluate(free, run).items():
        segment = own(run, dof)
        found += [
            ("reduction of mean width", dof, gone(result.reduction)),
            ("reduction of max width", dof, gone(result.reduction_max)),
            ("actuator gain", dof, result.actuator_gain),
            ("tip overspeed", dof, result.tip_overspeed),
            ("start", dof, result.start_periods),
            (
                "second period's width left",
                dof,
                abs(widths(run, segment)[1]) / result.uncompensated,
            ),
            ("tracking error", dof, result.tracking_rms),
            ("state error", dof, result.state_rms),
            ("frames used", dof, result.frames_used),
        ]
    return found


def gone(reduction: float) -> float:
    """Of a reduction above 1, a loop that runs the other way, as of one as wide that does not."""
    return 1 - abs(1 - reduction)


def own(run: Recording, dof: Dof) -> Segment:
    """The segment in which a DOF moves."""
    (segment,) = (each for each in run.segments if each.dof is dof)
    return segment


def widths(run: Recording, segment: Segment) -> Floats:
    """(periods,) mean width of the true tip over the reference."""
    label = segment.dof.label
    return metrics.period_widths(
        run.trace["time"],
        run.trace[f"reference_{label}"],
        run.trace[f"true_{label}"],
        start=float(run.trace["time"][0]) + segment.start,
        period=segment.period,
        periods=segment.periods,
    )


def together_plan(config: Config) -> Plan:
    motion = Sines(config.experiment, INCOMMENSURATE, TOGETHER)
    return {"free": uncompensated(config, motion), "run": Simulation(config, motion)}


def together(recordings: Recordings) -> Found:
    """All three DOFs at once."""
    found: Found = []
    for dof, result in evaluate(recordings["free"], recordings["run"]).items():
        found += [
            ("three DOFs at once: reduction", dof, gone(result.reduction)),
            ("three DOFs at once: tracking error", dof, result.tracking_rms),
            ("three DOFs at once: state error", dof, result.state_rms),
            ("three DOFs at once: frames used", dof, result.frames_used),
        ]
    return found


def insertion(config: Config, periods: float, **shake: float) -> Sines:
    """A sine on insertion."""
    period = config.experiment.insertion.period
    return Sines(config.experiment, ((Dof.INSERTION, period),), periods * period, **shake)


def changing_plan(config: Config) -> Plan:
    bent, period = config.twin.bends, config.experiment.insertion.period
    bends = zip((period * at for at in STRAIGHT), (bent, 0.0, 0.0, bent), strict=True)
    motion, short = insertion(config, CHANGING_PERIODS), insertion(config, 3)
    return {
        "run": Simulation(config, motion, bends=tuple(bends)),
        "bent": uncompensated(config, short),
        "straight": uncompensated(config.replace(**{"twin.bends": 0.0}), short),
    }


def changing(recordings: Recordings) -> Found:
    """The scope straightens and bends again, each over one period; insertion."""
    run = recordings["run"].trace
    settled = run["time"] >= 2 * recordings["run"].segments[0].period
    strokes = []
    for name, first, last in (
        ("straight", STRAIGHT[1], STRAIGHT[2]),
        ("bent", STRAIGHT[3], CHANGING_PERIODS),
    ):
        true = true_width(recordings[name])
        means = stroke_widths(recordings["run"], first - 0.25, last)
        strokes.append(metrics.until_within(means, true, 0.1 * true))
    return [
        (
            "width 10-2-10 mm: overshoot",
            Dof.INSERTION,
            metrics.overshoot(run["reference_insertion"][settled], run["true_insertion"][settled]),
        ),
        ("width 10-2-10 mm: strokes until within 10 %", Dof.INSERTION, float(np.max(strokes))),
    ]


def true_width(free: Recording) -> float:
    """Mean width of insertion without compensation, after the first period [m]."""
    (segment,) = free.segments
    rows = free.trace[free.during(segment, 1, segment.periods)]
    return metrics.loop_width(rows["command_insertion"], rows["true_insertion"]).mean


def stroke_widths(run: Recording, first: float, last: float) -> list[float]:
    """Mean estimated width of insertion in each stroke between two periods [m]."""
    (segment,) = run.segments
    trace = run.trace
    turns = trace["time"].searchsorted(np.arange(first, last, 0.5) * segment.period)
    estimate = trace["delta_plus_insertion"] - trace["delta_minus_insertion"]
    return [float(estimate[a:b].mean()) for a, b in pairwise(turns)]


def too_wide_plan(config: Config) -> Plan:
    half = 0.75 * NOMINAL
    wide = config.replace(**{"insertion.delta_minus": -half, "insertion.delta_plus": half})
    return {"run": Simulation(wide, insertion(config, WIDE_PERIODS))}


def too_wide(recordings: Recordings) -> Found:
    """The start values of insertion are 50 % too wide."""
    run = recordings["run"]
    (segment,) = run.segments
    each = []
    for period in range(segment.periods):
        rows = run.trace[run.during(segment, period, period + 1)]
        each.append(metrics.overshoot(rows["reference_insertion"], rows["true_insertion"]))
    gone = metrics.until_within(each, 0.0, GONE * NOMINAL)
    return [
        ("start 50 % too wide: overshoot", Dof.INSERTION, max(each)),
        ("start 50 % too wide: periods until gone", Dof.INSERTION, gone),
    ]


def latency_plan(config: Config) -> Plan:
    late = {
        name: Simulation(config.replace(**{"twin.latency": latency, "twin.latency_jitter": 0.0}))
        for name, latency in LATENCIES.items()
    }
    return alone_plan(config) | late


def changes(recordings: Recordings) -> Found:
    """How much the reduction changes from the run to each of the others."""
    free = recordings["free"]
    before = evaluate(free, recordings["run"])
    found: Found = []
    for name, recording in recordings.items():
        if name not in ("free", "run"):
            found += [
                (
                    f"{name}: change of reduction",
                    dof,
                    abs(gone(after.reduction) - gone(before[dof].reduction)),
                )
                for dof, after in evaluate(free, recording).items()
            ]
    return found


def latency(recordings: Recordings) -> Found:
    """The article's protocol with earlier and later images."""
    return [(f"latency {what}", dof, value) for what, dof, value in changes(recordings)]


def conditions_plan(config: Config) -> Plan:
    disturbed = {
        name: Simulation(config.replace(**{"twin.disturb": disturb}))
        for name, disturb in CONDITIONS.items()
    }
    return alone_plan(config) | disturbed


def tremor_plan(config: Config) -> Plan:
    sine = config.experiment.insertion
    plan = {}
    for beyond in RESTS:
        turned = np.arccos(1 - beyond / sine.amplitude) / (2 * np.pi) + 0.25
        rest = REST_AFTER + float(turned) * sine.period
        motion = insertion(config, (rest + REST_FOR) / sine.period, tremor=TREMOR, rest_at=rest)
        plan[f"{1e3 * beyond:g} mm"] = Simulation(config, motion)
    return plan


def tremor(recordings: Recordings) -> Found:
    """Tremor of 2 mm at 10 Hz: while the hand rests near a reversal, the worst place; before it."""
    rests = [resting(recording) for recording in recordings.values()]
    motor, tip = (
        max(metrics.peak_to_peak(rest[f"{what}_insertion"]) for rest in rests)
        for what in ("command", "true")
    )
    trace = next(iter(recordings.values())).trace
    moving = trace[(trace["time"] >= REST_AFTER / 2) & (trace["time"] < REST_AFTER)]
    motor_travel, hand_travel = (
        np.abs(np.diff(moving[f"{what}_insertion"])).sum() for what in ("command", "reference")
    )
    return [
        ("tremor at rest: motor", Dof.INSERTION, motor),
        ("tremor at rest: tip", Dof.INSERTION, tip),
        ("tremor: motor travel over hand's", Dof.INSERTION, motor_travel / hand_travel),
    ]


def resting(recording: Recording) -> Table:
    """The ticks in which the hand rests."""
    time = recording.trace["time"]
    rows: Table = recording.trace[time >= time[-1] - REST_FOR]
    return rows


SCENARIOS = {
    "alone": Scenario(alone_plan, alone),
    "together": Scenario(together_plan, together),
    "changing": Scenario(changing_plan, changing),
    "too wide": Scenario(too_wide_plan, too_wide),
    "latency": Scenario(latency_plan, latency),
    "tremor": Scenario(tremor_plan, tremor),
    "conditions": Scenario(conditions_plan, changes, profiles=("best",)),
}
