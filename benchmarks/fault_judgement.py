"""What a run with a fault comes to: how far the tip went, and whether anything was noticed.

Everything is against the run without the fault, which goes on from the same state with the same
noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from fault_bands import Band, Floats
from fault_draws import PLAY
from tautscope.twin.faults import KINDS, Fault, Target

Said = dict[str, Any]
"""As `fault_watch.Watch.said`."""
Intervals = Sequence[Sequence[float]]
"""(begin, end) of each [s from the fault's begin]."""

FREE_GAIN = 5.0
PASSING = 0.1 * PLAY
"""Goal for a fault that passes: 1.0 mm, and the like share of the other DOFs' slack."""
GIVEN_BACK = {"paper": 1 - 1 / FREE_GAIN, "best": 1.0}
"""Share of the slack that a profile makes up for, and gives back when it can no longer."""
SPARE = 0.03 * PLAY
"""0.3 mm, and the like."""
NEAR = 0.2
"""A flag so near one of the run without the fault is that one, come earlier or later [s]: the five
good frames after which flags end."""

HELD = {"hand_nan", "hand_silent", "stall", "stalls"}
"""While these act the hand means no motion; what it does then is not to be made up for."""


@dataclass(frozen=True)
class Traces:
    """What a run leaves behind, from the fault on.

    Attributes:
        truth: True states (n, 3) [m, rad, rad].
        commands: (n, 3), likewise.
        said: By the loop and the drives.
        meant: Positions the hand meant (n, 3); none where its device works.
        told: What came of them.
    """

    truth: Floats
    commands: Floats
    said: Said
    meant: Floats
    told: Floats


@dataclass(frozen=True)
class Outcome:
    """What is to be said of a run.

    Attributes:
        kind: Of the fault.
        seed: Of instrument, noise, motion, and when and how much fails.
        fault: What failed.
        excursion: How far the loop let the tip go (3,) [m, rad, rad]; this is what the goals limit.
            Where motors, scope, tissue or a hand that shakes or jumps move the tip by themselves,
            how much farther than they would have taken it under the commands of the run without
            the fault.
        tip: How far it went, whoever took it there (3,) [m, rad, rad].
        detected: Time from the fault to the first flag or refusal that is its own [s]; NaN if none.
        reaction: The highest.
        flags: All that are its own: raised at a time when without the fault they are not.
        stopped: Whether the motion was stopped.
        step: Largest change of the insertion command in a tick after the fault [m].
        width: Largest insertion slack the loop believed in [m].
        holds: How often learning was held or more, from the first tick of the loop on.
        stops: How often motion was held or more, likewise.
        raised: All flags of this run and of those it is compared with.
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
    def passing(self) -> bool:
        """Whether the fault passes."""
        return math.isfinite(self.fault.duration)


def lasting(profile: str) -> Floats:
    """Goal for a fault that stays: what is given back when compensation ends, and a little."""
    return np.asarray(GIVEN_BACK[profile] * PLAY + SPARE, dtype=np.float64)


def judged(
    excursion: Sequence[float], tip: Sequence[float], goal: Floats, noticed: bool, stopped: bool
) -> dict[str, Any]:
    """Whether the tip went farther than the goal, and how the run ended.

    ``stopped``, ``warned``, and of what was not noticed ``masked``: the tip was nowhere else;
    ``unnoticed``: it was, but no farther than the goal allows, or than motors, scope, tissue or the
    hand took it by themselves; ``SILENT``: beyond the goal.
    """
    beyond = bool((np.array(excursion) > goal).any())
    if stopped:
        ending = "stopped"
    elif noticed:
        ending = "warned"
    elif beyond:
        ending = "SILENT"
    else:
        ending = "unnoticed" if (np.array(tip) > PASSING).any() else "masked"
    return {"beyond": beyond, "ending": ending}


def outcome(
    seed: int,
    fault: Fault,
    found: Traces,
    base: Traces | None,
    usual: Said,
    *,
    band: Band | None = None,
    asked: Band | None = None,
) -> Outcome:
    """What a run comes to.

    Args:
        seed: Of the run.
        fault: What failed.
        found: The run.
        base: What its tip is compared with, if it came to move at all.
        usual: What is said without the fault.
        band: What the fault does by itself.
        asked: Where the hand's device says, if that is what fails.
    """
    said = dict(found.said)
    stop, flags = said.pop("stop_tick"), said.pop("flags")
    tip = far = np.zeros(3)
    if base is not None:
        tip = far = excursion(found.truth, base.truth, stop)
        if band is not None:
            far = excursion(found.truth, base.truth, stop, band)
        if asked is not None:
            # Where the hand's device says, the tip is to go.
            tip = excursion(found.truth, base.truth, stop, asked)
    others = [usual["flags"], {} if base is None else base.said["flags"]]
    own = {name: own_from(each, usual["flags"].get(name, ())) for name, each in flags.items()}
    own = {name: at for name, at in own.items() if math.isfinite(at)}
    return Outcome(
        fault.kind,
        seed,
        fault,
        excursion=_three(far),
        tip=_three(tip),
        detected=min(own.values(), default=math.nan),
        flags=tuple(own),
        raised=tuple(sorted(set(flags).union(*others))),
        **said,
    )


def own_from(found: Intervals, usual: Intervals) -> float:
    """When a flag is first raised while without the fault it is not [s]; infinite if never."""
    for begin, end in found:
        at = max(begin, 0.0)
        while at < end:
            over = [stop + NEAR for start, stop in usual if start - NEAR <= at < stop + NEAR]
            if not over:
                return at
            at = max(over)
    return math.inf


def excursion(truth: Floats, base: Floats, stop: int | None, band: Band | None = None) -> Floats:
    """How far the fault took the tip (3,) [m, rad, rad].

    Up to a stop, from where it was in the run without the fault, at the same time; from the stop
    on, from the way it went in that run after that time: a tip that comes to rest there is where it
    was meant to go. With a band, how far beyond it.
    """
    ticks = min(len(truth), len(base), *(len(each) for each in band or ()))
    last = ticks if stop is None else min(stop, ticks)
    low, high = base[:ticks].copy(), base[:ticks].copy()
    low[last:] = np.minimum.accumulate(base[last:ticks], axis=0)
    high[last:] = np.maximum.accumulate(base[last:ticks], axis=0)
    if band is not None:
        low, high = low + band[0][:ticks], high + band[1][:ticks]
    far = np.maximum(low - truth[:ticks], truth[:ticks] - high)
    return np.asarray(far.max(axis=0, initial=0.0), dtype=np.float64)


def _three(values: Floats) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


MOVED = {
    name
    for name, kind in KINDS.items()
    if kind.target is Target.PHYSICS or name.startswith("axis_") or name == "encoder_jump"
}
"""Kinds in which motors, scope or tissue move the tip by themselves."""
TAKEN = MOVED | {name for name, kind in KINDS.items() if kind.target is Target.REFERENCE} - HELD
"""Those, and kinds in which the hand's device says something else than the hand means."""
