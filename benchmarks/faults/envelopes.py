"""Envelopes: how far a fault moves the tip without any action of the loop.

Faults of motors, endoscope, tissue and input device move the tip by themselves. The loop is only
responsible for motion beyond the envelope.
"""

import numpy as np
from numpy.typing import NDArray
from tautscope.twin.faults import Fault

Floats = NDArray[np.float64]
Envelope = tuple[Floats, Floats]
"""Lower and upper bound (n, 3) of the tip, relative to the fault-free run [m, rad, rad]."""

ADDED_TO_INPUT = {"hand_noisy", "hand_spikes", "hand_tremor"}
"""Kinds that add to the intended motion. Motion that the reference gate rejects counts in full."""


def open_loop_envelope(faulty: Floats, nominal: Floats) -> Envelope:
    """Return how far the fault alone has moved the tip up to each tick.

    Args:
        faulty: True states with the fault under the commands of the fault-free run (n, 3).
        nominal: True states without the fault (n, 3).
    """
    ticks = min(len(faulty), len(nominal))
    return _running_bounds(faulty[:ticks] - nominal[:ticks])


def input_envelope(kind: str, intended: Floats, reported: Floats, max_motion: Floats) -> Envelope:
    """Return how far the reference of the input device has been off up to each tick.

    The loop rejects motion that is faster than its limit. The tip then follows the rest of the
    reference, as after clutching, except for kinds in `ADDED_TO_INPUT`.

    Args:
        kind: Kind of the fault.
        intended: Reference that the operator intended (n, 3).
        reported: Reference that the input device reported (n, 3).
        max_motion: Largest accepted motion per tick (3,): `safety.reference_speed` times period.
    """
    # The first command was sent before the fault.
    reported, intended = np.vstack([intended[:1], reported]), np.vstack([intended[:1], intended])
    error = reported - intended
    if kind in ADDED_TO_INPUT:
        return _running_bounds(error)
    motion = np.diff(reported, axis=0, prepend=reported[:1])
    rejected = np.cumsum(motion - np.clip(motion, -max_motion, max_motion), axis=0)
    return union(_running_bounds(error), _running_bounds(error - rejected))


def with_input_error(
    commands: Floats, intended: Floats, reported: Floats, stop: int | None
) -> Floats:
    """Return commands (n, 3) to which the error of the input device is added with gain 1.

    Args:
        commands: Commands of the fault-free run (n, 3).
        intended: See `input_envelope`.
        reported: See `input_envelope`.
        stop: Tick in which the loop stopped the motion; the error is constant from there on.
    """
    # The first command was sent before the fault.
    error = np.vstack([np.zeros(3), reported - intended])
    ticks = min(len(commands), len(error))
    error = error[:ticks]
    if stop is not None:
        error[stop:] = error[max(stop - 1, 0)]
    return commands[:ticks] + error


def delay_envelope(fault: Fault, nominal: Floats, period: float) -> Envelope:
    """Return the envelope of a delayed input device: the fault-free tip, delayed.

    Args:
        fault: Its size is the delay [s].
        nominal: True states without the fault, from its start on (n, 3).
        period: Sampling period [s].
    """
    delayed = np.arange(len(nominal)) - round(fault.size / period)
    return _running_bounds(nominal[np.maximum(delayed, 0)] - nominal)


def union(one: Envelope, other: Envelope) -> Envelope:
    """Return the union of two envelopes; the shorter one is continued with its last values."""
    ticks = max(len(one[0]), len(other[0]))
    (low, high), (other_low, other_high) = (
        tuple(np.vstack([each, np.repeat(each[-1:], ticks - len(each), axis=0)]) for each in bounds)
        for bounds in (one, other)
    )
    return np.minimum(low, other_low), np.maximum(high, other_high)


def _running_bounds(error: Floats) -> Envelope:
    low = np.minimum.accumulate(np.minimum(error, 0.0), axis=0)
    return low, np.maximum.accumulate(np.maximum(error, 0.0), axis=0)
