"""Evaluation of a run with a fault: excursion of the tip, detection, and verdict.

Everything is relative to the fault-free run, which continues from the same state with the same
noise.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from faults.envelopes import Envelope, Floats
from faults.scenarios import SLACK
from tautscope.twin.faults import KINDS, Fault, Target

Summary = dict[str, Any]
"""See `faults.recorder.RunRecorder.summary`."""
Intervals = Sequence[Sequence[float]]
"""(start, end) of each interval [s from the start of the fault]."""

FREE_GAIN = 5.0
TRANSIENT_GOAL = 0.1 * SLACK
"""Largest excursion for a transient fault: 1.0 mm, and the same share of the other DOFs' slack."""
COMPENSATED_SHARE = {"paper": 1 - 1 / FREE_GAIN, "best": 1.0}
"""Share of the slack that a profile compensates; the tip loses it when compensation ends."""
MARGIN = 0.03 * SLACK
"""Allowed in addition: 0.3 mm, and the same share of the other DOFs' slack."""
FLAG_TOLERANCE = 0.2
"""A flag within this time of the same flag in the fault-free run is not due to the fault [s]; flags
end after five good frames, which take as long."""

INPUT_PAUSED = {"hand_nan", "hand_silent", "stall", "stalls"}
"""Kinds during which the intended motion pauses; the motion of that time is not to be caught up."""
MOVES_TIP = {
    name
    for name, kind in KINDS.items()
    if kind.target is Target.PHYSICS or name.startswith("axis_") or name == "encoder_jump"
}
"""Kinds in which motors, endoscope or tissue move the tip by themselves."""


@dataclass(frozen=True)
class Traces:
    """Traces of a run, from the start of the fault on.

    Attributes:
        truth: True states (n, 3) [m, rad, rad].
        commands: Commands (n, 3), likewise.
        summary: Flags and reactions.
        intended: Intended references (n, 3); empty where the input device works.
        reported: Reported references, likewise.
    """

    truth: Floats
    commands: Floats
    summary: Summary
    intended: Floats
    reported: Floats


@dataclass(frozen=True)
class Outcome:
    """Outcome of a run. The attributes are keys of the rows in JSON files.

    Attributes:
        kind: Kind of the fault.
        seed: Seed of instrument, noise, motion and fault.
        fault: The fault.
        excursion: Largest excursion of the tip that the loop is responsible for (3,) [m, rad, rad];
            the goals limit it. Where the fault has an envelope, this is the distance beyond it.
        tip: Largest excursion of the tip, whatever its cause (3,) [m, rad, rad].
        detected: Detection time: from the fault to the first flag or refusal due to it [s]; NaN if
            it was not detected.
        reaction: Highest reaction.
        flags: Flags due to the fault.
        stopped: Whether the motion was stopped.
        step: Largest change of the insertion command in one tick after the fault [m].
        width: Largest estimated slack of insertion [m].
        holds: How often estimation or more was held, from the first tick on.
        stops: How often motion or more was held, from the first tick on.
        raised: All flags of this run and of the runs it is compared with.
    """

    kind: str
    seed: int
    fault: Fault
    excursion: tuple[float, float, float]
    tip: tuple[float, float, float]
    detected: float
    reaction: str
    flags: tuple[str, ...]
    stopped: bool
    step: float
    width: float
    holds: int
    stops: int
    raised: tuple[str, ...]

    @property
    def is_transient(self) -> bool:
        """Whether the fault ends."""
        return math.isfinite(self.fault.duration)


def permanent_goal(profile: str) -> Floats:
    """Return the largest excursion for a permanent fault: the compensated slack, and a margin."""
    return np.asarray(COMPENSATED_SHARE[profile] * SLACK + MARGIN, dtype=np.float64)


def classify(
    excursion: Sequence[float],
    tip: Sequence[float],
    goal: Floats,
    is_detected: bool,
    is_stopped: bool,
) -> dict[str, Any]:
    """Return whether the excursion exceeds the goal, and the verdict.

    Detected faults end ``stopped`` or ``warned``. Undetected ones are ``masked`` if the tip stays
    within the goal for transient faults; ``unnoticed`` if it leaves it, but neither exceeds the
    goal of this fault nor its envelope; ``SILENT`` if it exceeds the goal.
    """
    exceeds = bool((np.array(excursion) > goal).any())
    if is_stopped:
        ending = "stopped"
    elif is_detected:
        ending = "warned"
    elif exceeds:
        ending = "SILENT"
    else:
        ending = "unnoticed" if (np.array(tip) > TRANSIENT_GOAL).any() else "masked"
    return {"beyond": exceeds, "ending": ending}


def evaluate_run(
    seed: int,
    fault: Fault,
    run: Traces,
    nominal: Traces | None,
    usual: Summary,
    *,
    envelope: Envelope | None = None,
    reported: Envelope | None = None,
) -> Outcome:
    """Evaluate a run.

    Args:
        seed: Seed of the run.
        fault: The fault.
        run: Traces of the run.
        nominal: Traces that the tip is compared with; None if the run was refused.
        usual: Summary of the fault-free run.
        envelope: What the fault does by itself.
        reported: Envelope of the references that a faulty input device reported.
    """
    summary = dict(run.summary)
    stop, flags = summary.pop("stop_tick"), summary.pop("flags")
    tip = own = np.zeros(3)
    if nominal is not None:
        tip = own = excursion(run.truth, nominal.truth, stop)
        if envelope is not None:
            own = excursion(run.truth, nominal.truth, stop, envelope)
        if reported is not None:
            # The tip should follow the reported reference.
            tip = excursion(run.truth, nominal.truth, stop, reported)
    others = [usual["flags"], {} if nominal is None else nominal.summary["flags"]]
    first = {
        name: detection_time(each, usual["flags"].get(name, ())) for name, each in flags.items()
    }
    first = {name: time for name, time in first.items() if math.isfinite(time)}
    return Outcome(
        fault.kind,
        seed,
        fault,
        excursion=_as_tuple(own),
        tip=_as_tuple(tip),
        detected=min(first.values(), default=math.nan),
        flags=tuple(first),
        raised=tuple(sorted(set(flags).union(*others))),
        **summary,
    )


def detection_time(raised: Intervals, usual: Intervals) -> float:
    """Return when a flag is first raised but not in the fault-free run [s]; infinity if never."""
    for start, end in raised:
        time = max(start, 0.0)
        while time < end:
            excused = [
                last + FLAG_TOLERANCE
                for first, last in usual
                if first - FLAG_TOLERANCE <= time < last + FLAG_TOLERANCE
            ]
            if not excused:
                return time
            time = max(excused)
    return math.inf


def excursion(
    truth: Floats, nominal: Floats, stop: int | None, envelope: Envelope | None = None
) -> Floats:
    """Return the largest excursion of the tip from the fault-free run (3,) [m, rad, rad].

    Before a stop, the distance from the fault-free tip at the same time. After it, the distance
    from the range that the fault-free tip covers from the stop on: a tip that comes to rest there
    is where it should be. With an envelope, the distance beyond it.
    """
    ticks = min(len(truth), len(nominal), *(len(each) for each in envelope or ()))
    last = ticks if stop is None else min(stop, ticks)
    low, high = nominal[:ticks].copy(), nominal[:ticks].copy()
    low[last:] = np.minimum.accumulate(nominal[last:ticks], axis=0)
    high[last:] = np.maximum.accumulate(nominal[last:ticks], axis=0)
    if envelope is not None:
        low, high = low + envelope[0][:ticks], high + envelope[1][:ticks]
    distance = np.maximum(low - truth[:ticks], truth[:ticks] - high)
    return np.asarray(distance.max(axis=0, initial=0.0), dtype=np.float64)


def _as_tuple(values: Floats) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
