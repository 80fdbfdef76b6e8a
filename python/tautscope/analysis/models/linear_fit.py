"""A straight line between command and tip: no hysteresis."""

from tautscope.analysis.models.task import Prediction, Task, fit_line


def run(task: Task) -> Prediction:
    """Fit tip = gain * command + offset to the first half, and predict.

    Only the offset is fitted if the gain is given. Wrong as an estimate of the gain in contact:
    hysteresis flattens the line.
    """
    gain, offset = fit_line(*task.first_half, task.gain)
    return Prediction(gain * task.command + offset, {"gain": gain, "offset": offset})
