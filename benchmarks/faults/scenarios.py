"""Scenarios of the fault campaign: instrument, motion, and a randomly drawn fault."""

import math

import numpy as np
from tautscope.config import Config, Profile, load_config
from tautscope.dof import Dof
from tautscope.twin.fault_motion import EVENT_RATE
from tautscope.twin.faults import KINDS, PER_MM, Fault, Target

PERIODS = {Dof.INSERTION: 7.5, Dof.ROTATION: 10.0, Dof.BENDING: 10.0}
"""Periods of the reference sines [s]; insertion, with 15 mm, reaches 12.6 mm/s."""
ESTIMATION_TIME = 15.0
"""Time in which the loop estimates the slack; the fault starts in the period after it [s]."""
OBSERVED_AFTER = 4.0
"""Observation time after the end of a transient fault: a stroke with its reversal [s]."""
OBSERVED_PERMANENT = 10.0
"""Observation time after the start of a permanent fault [s]."""
DURATION = (0.1, 2.0)
"""Shortest and longest duration of a transient fault [s]."""
TRANSIENT_SHARE = 0.7
"""Share of transient faults, for kinds that can be either."""
LOGARITHMIC = 30.0
"""Ratio of largest to smallest severity above which severities are drawn log-uniformly."""
SLACK = np.array([10e-3, 1.8, 1.1])
"""Slack of the instrument, the article's Table 1 [m, rad, rad]."""
START_KINDS = {name for name, kind in KINDS.items() if kind.target is Target.START}
"""Kinds that are present before the first tick."""


def build_config(seed: int, profile: Profile, off: tuple[str, ...]) -> Config:
    """Return the configuration of loop and twin, with some detectors off."""
    changes: dict[str, object] = {"twin.seed": seed}
    if off:
        changes["safety.off"] = off
    return load_config(profile=profile).replace(**changes)


def fault_start(config: Config, seed: int) -> float:
    """Draw the start of the fault, on a tick, anywhere in a period of insertion [s]."""
    delay = np.random.default_rng([seed, 6]).uniform(0, PERIODS[Dof.INSERTION])
    return round((ESTIMATION_TIME + delay) / config.control.period) * config.control.period


def moving_dofs(seed: int) -> tuple[Dof, ...]:
    """Return the DOFs that move: insertion alone, or all three."""
    return tuple(Dof) if seed % 2 else (Dof.INSERTION,)


def draw_fault(kind: str, seed: int, start: float, longest: float = DURATION[1]) -> Fault:
    """Draw duration, at most `longest` if transient, DOF and severity of a fault."""
    row = KINDS[kind]
    rng = np.random.default_rng([seed, 7, *kind.encode()])
    is_transient = row.has_duration and rng.uniform() < TRANSIENT_SHARE
    duration = float(rng.uniform(DURATION[0], longest)) if is_transient else math.inf
    dof = Dof(int(rng.choice(moving_dofs(seed))))
    low, high = row.severity
    if low > 0 and high / low > LOGARITHMIC:
        size = float(np.clip(np.exp(rng.uniform(np.log(low), np.log(high))), low, high))
    else:
        size = float(rng.uniform(low, high))
    return Fault(kind, start, duration, size, dof)


def observation_time(fault: Fault) -> float:
    """Return how long the tip is observed from the start of the fault on [s]."""
    is_transient = math.isfinite(fault.duration)
    return fault.duration + OBSERVED_AFTER if is_transient else OBSERVED_PERMANENT


def input_pauses(fault: Fault) -> list[tuple[float, float]]:
    """Return (start, end) of each interval in which the fault interrupts the reference [s]."""
    if fault.kind == "stall":
        return [(fault.start, fault.start + fault.size)]
    end = fault.start + min(fault.duration, OBSERVED_PERMANENT)
    if fault.kind == "stalls":
        starts = np.arange(fault.start, end, 1 / EVENT_RATE)
        return [(float(start), float(start) + fault.size) for start in starts]
    return [(fault.start, end)]


def with_start_values(config: Config, fault: Fault) -> Config:
    """Return the configuration with the start values of a fault; the right ones without a fault.

    Raises:
        ConfigError: The start values are invalid.
    """
    widths = {
        "start_wide": fault.size,
        "start_narrow": fault.size,
        "start_negative": -1.0,
        "start_nan": math.nan,
    }
    width = widths.get(fault.kind, 1.0)
    shift = fault.size if fault.kind == "start_shifted" else 0.0
    changes: dict[str, float] = {}
    for dof in Dof:
        middle, half = shift * PER_MM[dof], width * float(SLACK[dof]) / 2
        changes[f"{dof.label}.delta_minus"] = middle - half
        changes[f"{dof.label}.delta_plus"] = middle + half
    return config.replace(**changes)
