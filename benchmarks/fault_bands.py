"""How far a fault may take the tip by itself, and the loop answers for what it adds to that.

Motors, scope and tissue do, and what the hand's device says.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from tautscope.twin.faults import Fault

Floats = NDArray[np.float64]
Band = tuple[Floats, Floats]
"""(n, 3) each: how far below and above the run without the fault the tip may be."""

SHAKEN = {"hand_noisy", "hand_spikes", "hand_tremor"}
"""The hand goes on as it meant to: whatever is thrown away of its motion counts."""


def by_itself(alone: Floats, base: Floats) -> Band:
    """As far as a fault of motors, scope or tissue took the tip so far.

    Args:
        alone: True states with the fault, under the commands of the run without it (n, 3).
        base: Those without it.
    """
    ticks = min(len(alone), len(base))
    return _so_far(alone[:ticks] - base[:ticks])


def by_the_hand(kind: str, meant: Floats, told: Floats, reach: Floats) -> Band:
    """As far as the hand's device erred so far.

    Motion faster than the loop takes is thrown away: from then on the tip belongs where the rest of
    it leads, as when the hand engages again. Not so where the hand shakes and goes on as it meant.

    Args:
        kind: Of the fault.
        meant: What the hand did (n, 3).
        told: What its device said (n, 3).
        reach: What the loop takes in a tick (3,), `safety.reference_speed` times the period.
    """
    # The first command was made before the fault.
    told, meant = np.vstack([meant[:1], told]), np.vstack([meant[:1], meant])
    error = told - meant
    if kind in SHAKEN:
        return _so_far(error)
    moved = np.diff(told, axis=0, prepend=told[:1])
    thrown = np.cumsum(moved - np.clip(moved, -reach, reach), axis=0)
    (low, high), (less, more) = _so_far(error), _so_far(error - thrown)
    return np.minimum(low, less), np.maximum(high, more)


def as_told(commands: Floats, meant: Floats, told: Floats, stop: int | None) -> Floats:
    """What motors would be told if the device's error went to them as it is (n, 3).

    Args:
        commands: Of the run without the fault.
        meant: As `by_the_hand`.
        told: As `by_the_hand`.
        stop: The tick in which the loop stopped the motion; the error stays from there on.
    """
    # The first command was made before the fault.
    error = np.vstack([np.zeros(3), told - meant])
    ticks = min(len(commands), len(error))
    error = error[:ticks]
    if stop is not None:
        error[stop:] = error[max(stop - 1, 0)]
    return commands[:ticks] + error


def as_late(fault: Fault, base: Floats, period: float) -> Band:
    """Where a tip is whose hand is late: where it was so long ago, without the fault.

    Args:
        fault: Its device says what it did so long ago, and the first until that is known.
        base: True states without the fault, from its begin on (n, 3).
        period: From one to the next [s].
    """
    ago = np.arange(len(base)) - round(fault.size / period)
    return _so_far(base[np.maximum(ago, 0)] - base)


def wider(one: Band, other: Band) -> Band:
    """What is within either; the shorter goes on as it ends."""
    ticks = max(len(one[0]), len(other[0]))
    (low, high), (less, more) = (
        tuple(np.vstack([each, np.repeat(each[-1:], ticks - len(each), axis=0)]) for each in band)
        for band in (one, other)
    )
    return np.minimum(low, less), np.maximum(high, more)


def _so_far(error: Floats) -> Band:
    low = np.minimum.accumulate(np.minimum(error, 0.0), axis=0)
    return low, np.maximum.accumulate(np.maximum(error, 0.0), axis=0)
