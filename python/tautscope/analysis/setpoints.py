"""The motion behind a command that is logged in steps: setpoints, counts, bursts of samples."""

import numpy as np
from numpy.typing import NDArray

from tautscope.analysis.delayed_play import resolution
from tautscope.analysis.models.task import Floats
from tautscope.runs.records import Record

REST = 3.0
"""A command that is held for more of the usual times is at rest."""
BURST = 20
"""Samples over which the rate is that of the record."""
LEAST_STEP = 0.01
"""Of the command's range: smaller steps are as good as a smooth motion."""


def held_for(record: Record) -> float:
    """Usual time between setpoints [s or samples]; 0 where the command is no held setpoints.

    An encoder repeats its values, too, but changes mostly by its resolution.
    """
    command, new = record.command, np.flatnonzero(np.diff(record.command)) + 1
    if len(new) < 2 or np.median(np.diff(new)) < 2:
        return 0.0
    step = float(np.median(np.abs(command[new] - command[new - 1])))
    if step < 1.5 * resolution(command) or step < LEAST_STEP * float(np.ptp(command)):
        return 0.0
    return float(np.median(np.diff(record.clock[new])))


def ramped(record: Record) -> Floats:
    """The command (n,), from each new value on a ramp to the next, but for rests."""
    at = _apart(record.clock)
    clock, command = record.clock[at], record.command[at]
    new = np.flatnonzero(np.diff(command)) + 1
    if len(new) < 2:
        return record.command
    usual = float(np.median(np.diff(clock[new])))
    knots = np.concatenate([[0], new, [len(clock) - 1]])
    times, values = clock[knots], command[knots]
    is_rest = np.diff(times) > REST * usual
    ends = times[1:][is_rest] - usual
    times, values = np.append(times, ends), np.append(values, values[:-1][is_rest])
    order = np.argsort(times, kind="stable")
    return np.asarray(np.interp(record.clock, times[order], values[order]))


def _apart(clock: Floats) -> NDArray[np.intp]:
    """Samples of a clock, of those that are stamped in a burst the first alone."""
    count = min(BURST, len(clock) - 1)
    interval = float(np.median(clock[count:] - clock[:-count])) / count
    return np.flatnonzero(np.diff(clock, prepend=-np.inf) > interval / 2)
