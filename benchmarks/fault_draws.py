"""The runs of the fault campaign: which instrument and hand, what fails when, and how much."""

from __future__ import annotations

import math

import numpy as np
from tautscope.config import Config, Profile, load_config
from tautscope.dof import Dof
from tautscope.twin.fault_motion import EVENT_RATE
from tautscope.twin.faults import KINDS, PER_MM, Fault, Target

PERIODS = {Dof.INSERTION: 7.5, Dof.ROTATION: 10.0, Dof.BENDING: 10.0}
"""Of the hand's sines [s]; insertion, with 15 mm, reaches 12.6 mm/s."""
LEARNING = 15.0
"""In which the slack is learnt; the fault comes in the stroke forth and back after it [s]."""
WATCHED = 4.0
"""After the end of a fault that passes: a stroke, with its reversal, and a little [s]."""
WATCHED_FOR_GOOD = 10.0
"""After the begin of one that stays [s]."""
PASSES = (0.1, 2.0)
"""How long the others take [s]."""
SHARE_PASSING = 0.7
DECADES = 30.0
"""Severities that span more are drawn evenly in their logarithm."""
PLAY = np.array([10e-3, 1.8, 1.1])
"""Slack of the instrument, the article's Table 1 [m, rad, rad]."""
STARTS = {name for name, kind in KINDS.items() if kind.target is Target.START}
"""Kinds that are there before the first tick."""


def configured(seed: int, profile: Profile, off: tuple[str, ...]) -> Config:
    """Of loop and twin."""
    changes: dict[str, object] = {"twin.seed": seed}
    if off:
        changes["safety.off"] = off
    return load_config(profile=profile).replace(**changes)


def began(config: Config, seed: int) -> float:
    """When the fault begins: on a tick, anywhere in a stroke forth and back [s]."""
    later = np.random.default_rng([seed, 6]).uniform(0, PERIODS[Dof.INSERTION])
    return round((LEARNING + later) / config.control.period) * config.control.period


def moving(seed: int) -> tuple[Dof, ...]:
    """Insertion alone, or all three DOFs."""
    return tuple(Dof) if seed % 2 else (Dof.INSERTION,)


def drawn(kind: str, seed: int, start: float) -> Fault:
    """The fault of this kind and seed."""
    row = KINDS[kind]
    chance = np.random.default_rng([seed, 7, *kind.encode()])
    passes = row.has_duration and chance.uniform() < SHARE_PASSING
    duration = float(chance.uniform(*PASSES)) if passes else math.inf
    dof = Dof(int(chance.choice(moving(seed))))
    low, high = row.severity
    if low > 0 and high / low > DECADES:
        size = float(np.clip(np.exp(chance.uniform(np.log(low), np.log(high))), low, high))
    else:
        size = float(chance.uniform(low, high))
    return Fault(kind, start, duration, size, dof)


def watched(fault: Fault) -> float:
    """How long, from the begin of the fault [s]."""
    passes = math.isfinite(fault.duration)
    return fault.duration + WATCHED if passes else WATCHED_FOR_GOOD


def pauses(fault: Fault) -> list[tuple[float, float]]:
    """When the hand means no motion because of a fault [s]."""
    if fault.kind == "stall":
        return [(fault.start, fault.start + fault.size)]
    end = fault.start + min(fault.duration, WATCHED_FOR_GOOD)
    if fault.kind == "stalls":
        begins = np.arange(fault.start, end, 1 / EVENT_RATE)
        return [(float(begin), float(begin) + fault.size) for begin in begins]
    return [(fault.start, end)]


def told(config: Config, fault: Fault) -> Config:
    """The configuration that says a wrong slack.

    Raises:
        ConfigError: Of a slack that cannot be.
    """
    width, shift = 1.0, 0.0
    if fault.kind in {"start_wide", "start_narrow"}:
        width = fault.size
    elif fault.kind == "start_shifted":
        shift = fault.size
    elif fault.kind == "start_negative":
        width = -1.0
    elif fault.kind == "start_nan":
        width = math.nan
    changes: dict[str, float] = {}
    for dof in Dof:
        middle, half = shift * PER_MM[dof], width * float(PLAY[dof]) / 2
        changes[f"{dof.label}.delta_minus"] = middle - half
        changes[f"{dof.label}.delta_plus"] = middle + half
    return config.replace(**changes)
