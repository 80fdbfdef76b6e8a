"""Scenarios of the hysteresis benchmark: their runs, and the values measured on the recordings."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from hysteresis import measures
from hysteresis.goals import CONDITIONS, LATENCIES, OPERATORS
from hysteresis.simulation import Simulation, Sines, uncompensated
from hysteresis.store import Recordings
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.report import metrics
from tautscope.report.operator_motion import evaluate_operator_motion, operator_motion
from tautscope.report.results import evaluate
from tautscope.runs.recording import Recording, Table

Plan = dict[str, Simulation]
Found = list[tuple[str, Dof, float]]
"""Quantity, DOF, value; in metres, radians or as a share."""

NOMINAL_WIDTH = 10e-3
"""Uncompensated width of insertion: the article's Table 1, to which the twin is set [m]."""
INCOMMENSURATE = ((Dof.INSERTION, 10.0), (Dof.ROTATION, 7.3), (Dof.BENDING, 8.9))
TOGETHER_DURATION = 60.0
STRAIGHT = (3, 4, 7, 8)
"""The endoscope straightens between the first two periods and bends between the last two."""
CHANGING_PERIODS = 11
WIDE_PERIODS = 4
NEGLIGIBLE = 0.05
"""Overshoot that counts as none, as a share of the uncompensated width."""
TREMOR = 1e-3
"""Amplitude of the tremor: 2 mm peak to peak [m]."""
RESTS = (0.0, 1e-3, 2e-3)
"""How far beyond a reversal the reference stops [m]."""
REST_AFTER, REST_FOR = 20.0, 5.0
"""The reference stops after the reversal that follows the first time, for the second [s]."""


@dataclass(frozen=True)
class Scenario:
    """One group of rows.

    Attributes:
        plan: Returns the runs of a configuration by name.
        measure: Returns the values measured on their recordings.
        profiles: Profiles that are measured.
    """

    plan: Callable[[Config], Plan]
    measure: Callable[[Recordings], Found]
    profiles: tuple[str, ...] = ("paper", "best")


def operator_plan(config: Config) -> Plan:
    runs: Plan = {}
    for name in OPERATORS:
        motion = operator_motion(config, is_disturbed=name != "operator")
        runs |= {f"{name}, free": uncompensated(config, motion), name: Simulation(config, motion)}
    return runs


def operator(recordings: Recordings) -> Found:
    """Measure the motion of an operator, after its first 40 s."""
    found: Found = []
    for name in OPERATORS:
        results = evaluate_operator_motion(recordings[f"{name}, free"], recordings[name])
        for dof, result in results.items():
            found += [
                (f"{name}: reduction of tracking error", dof, result.reduction),
                (f"{name}: tracking error", dof, result.compensated_rms),
                (f"{name}: largest error", dof, result.largest),
                (f"{name}: tip overspeed", dof, result.overspeed),
            ]
            # The reference with tremor never rests, and the bound has no filter of the tremor.
            if name == "operator":
                found += [
                    (f"{name}: creep", dof, result.creep),
                    (f"{name}: bound of the reduction", dof, result.bound),
                ]
    return found


def alone_plan(config: Config) -> Plan:
    return {"free": uncompensated(config), "run": Simulation(config)}


def alone(recordings: Recordings) -> Found:
    """Measure the article's protocol."""
    free, run = recordings["free"], recordings["run"]
    found: Found = []
    for dof, result in evaluate(free, run).items():
        segment = measures.segment_of(run, dof)
        found += [
            ("reduction of mean width", dof, result.reduction),
            ("reduction of max width", dof, result.reduction_max),
            ("actuator gain", dof, result.actuator_gain),
            ("tip overspeed", dof, result.tip_overspeed),
            ("start", dof, result.start_periods),
            (
                "second period's width left",
                dof,
                abs(measures.period_widths(run, segment)[1]) / result.uncompensated,
            ),
            ("tracking error", dof, result.tracking_rms),
            ("state error", dof, result.state_rms),
            ("frames used", dof, result.frames_used),
        ]
    return found


def together_plan(config: Config) -> Plan:
    motion = Sines(config.experiment, INCOMMENSURATE, TOGETHER_DURATION)
    return {"free": uncompensated(config, motion), "run": Simulation(config, motion)}


def together(recordings: Recordings) -> Found:
    """Measure all three DOFs at once."""
    found: Found = []
    for dof, result in evaluate(recordings["free"], recordings["run"]).items():
        found += [
            ("three DOFs at once: reduction", dof, result.reduction),
            ("three DOFs at once: tracking error", dof, result.tracking_rms),
            ("three DOFs at once: state error", dof, result.state_rms),
            ("three DOFs at once: frames used", dof, result.frames_used),
        ]
    return found


def insertion(config: Config, periods: float, **tremor: float) -> Sines:
    """Return a sine on insertion."""
    period = config.experiment.insertion.period
    return Sines(config.experiment, ((Dof.INSERTION, period),), periods * period, **tremor)


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
    """Measure insertion while the endoscope straightens and bends again, each over one period."""
    run = recordings["run"].trace
    settled = run["time"] >= 2 * recordings["run"].segments[0].period
    strokes = []
    for name, first, last in (
        ("straight", STRAIGHT[1], STRAIGHT[2]),
        ("bent", STRAIGHT[3], CHANGING_PERIODS),
    ):
        true = measures.uncompensated_width(recordings[name])
        means = measures.stroke_widths(recordings["run"], first - 0.25, last)
        strokes.append(metrics.until_within(means, true, 0.1 * true))
    return [
        (
            "width 10-2-10 mm: overshoot",
            Dof.INSERTION,
            metrics.overshoot(run["reference_insertion"][settled], run["true_insertion"][settled]),
        ),
        ("width 10-2-10 mm: strokes until within 10 %", Dof.INSERTION, float(np.max(strokes))),
    ]


def too_wide_plan(config: Config) -> Plan:
    half = 0.75 * NOMINAL_WIDTH
    wide = config.replace(**{"insertion.delta_minus": -half, "insertion.delta_plus": half})
    return {"run": Simulation(wide, insertion(config, WIDE_PERIODS))}


def too_wide(recordings: Recordings) -> Found:
    """Measure insertion with start values that are 50 % too wide."""
    run = recordings["run"]
    (segment,) = run.segments
    each = []
    for period in range(segment.periods):
        rows = run.trace[run.during(segment, period, period + 1)]
        each.append(metrics.overshoot(rows["reference_insertion"], rows["true_insertion"]))
    periods = metrics.until_within(each, 0.0, NEGLIGIBLE * NOMINAL_WIDTH)
    return [
        ("start 50 % too wide: overshoot", Dof.INSERTION, max(each)),
        ("start 50 % too wide: periods until gone", Dof.INSERTION, periods),
    ]


def latency_plan(config: Config) -> Plan:
    late = {
        name: Simulation(config.replace(**{"twin.latency": latency, "twin.latency_jitter": 0.0}))
        for name, latency in LATENCIES.items()
    }
    return alone_plan(config) | late


def changes(recordings: Recordings) -> Found:
    """Measure how much the reduction differs between the first run and each other one."""
    free = recordings["free"]
    before = evaluate(free, recordings["run"])
    found: Found = []
    for name, recording in recordings.items():
        if name not in ("free", "run"):
            found += [
                (
                    f"{name}: change of reduction",
                    dof,
                    abs(after.reduction - before[dof].reduction),
                )
                for dof, after in evaluate(free, recording).items()
            ]
    return found


def latency(recordings: Recordings) -> Found:
    """Measure the article's protocol with shorter and longer latency."""
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
    """Measure a tremor of 2 mm at 10 Hz: at rest near a reversal, worst place; and in motion."""
    rests = [resting(recording) for recording in recordings.values()]
    motor, tip = (
        max(metrics.peak_to_peak(rest[f"{what}_insertion"]) for rest in rests)
        for what in ("command", "true")
    )
    trace = next(iter(recordings.values())).trace
    moving = trace[(trace["time"] >= REST_AFTER / 2) & (trace["time"] < REST_AFTER)]
    motor_travel, reference_travel = (
        np.abs(np.diff(moving[f"{what}_insertion"])).sum() for what in ("command", "reference")
    )
    return [
        ("tremor at rest: motor", Dof.INSERTION, motor),
        ("tremor at rest: tip", Dof.INSERTION, tip),
        ("tremor: motor travel over reference's", Dof.INSERTION, motor_travel / reference_travel),
    ]


def resting(recording: Recording) -> Table:
    """Return the ticks in which the intended motion rests."""
    time = recording.trace["time"]
    rows: Table = recording.trace[time >= time[-1] - REST_FOR]
    return rows


SCENARIOS = {
    "operator": Scenario(operator_plan, operator),
    "alone": Scenario(alone_plan, alone),
    "together": Scenario(together_plan, together),
    "changing": Scenario(changing_plan, changing),
    "too wide": Scenario(too_wide_plan, too_wide),
    "latency": Scenario(latency_plan, latency),
    "tremor": Scenario(tremor_plan, tremor),
    "conditions": Scenario(conditions_plan, changes, profiles=("best",)),
}
