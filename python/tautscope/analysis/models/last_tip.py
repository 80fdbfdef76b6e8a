"""Two trivial predictors: the last measured tip, and that plus gain times command change."""

import numpy as np

from tautscope.analysis.models.task import Floats, Prediction, Task, last_seen


def run(task: Task) -> Prediction:
    """Predict the last measured tip."""
    return Prediction(_from_second_half(task, last_tip(task, 0.0)), {})


def run_with_gain(task: Task) -> Prediction:
    """Predict the last measured tip plus gain times the change of the command since then."""
    slope = gain(task)
    return Prediction(_from_second_half(task, last_tip(task, slope)), {"gain": slope})


def last_tip(task: Task, slope: float) -> Floats:
    """Last measured tip plus slope times the command's change, (n,); NaN before the first tip."""
    at = last_seen(task.measured)
    tip = task.measured[at] + slope * (task.command - task.command[at])
    return np.where(at >= 0, tip, np.nan)


def gain(task: Task) -> float:
    """The given gain; else that of the changes between measured tips of the first half.

    Least squares of tip change = gain * command change. Slack makes it smaller than the gain in
    contact, the more so the denser the measured tips.
    """
    if task.gain is not None:
        return task.gain
    command, measured = task.first_half
    with_tip = np.isfinite(measured)
    moved, followed = np.diff(command[with_tip]), np.diff(measured[with_tip])
    power = float(moved @ moved)
    return float(moved @ followed) / power if power > 0 else 0.0


def _from_second_half(task: Task, tip: Floats) -> Floats:
    return np.where(np.arange(len(tip)) >= task.half, tip, np.nan)
