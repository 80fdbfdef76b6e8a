"""No model of hysteresis: the tip is where the command is, on a straight line."""

from __future__ import annotations

from dataclasses import asdict, dataclass

from tautscope.analysis.models.task import Floats, Prediction, Task, line, seen


@dataclass(frozen=True)
class StraightLine:
    """Tip = gain * command + offset.

    Attributes:
        gain: Tip's unit per command's unit.
        offset: [tip's unit].
    """

    gain: float
    offset: float

    def predict(self, command: Floats) -> Floats:
        """Tip (n,) for a command (n,)."""
        return self.gain * command + self.offset


def fit(command: Floats, measured: Floats, gain: float | None = None) -> StraightLine:
    """The line of least squares; with a given gain its offset only.

    Wrong as an estimate of the gain in contact: slack flattens the line.
    """
    where = seen(measured)
    return StraightLine(*line(command[where], measured[where], gain))


def run(task: Task) -> Prediction:
    """Fitted to the first half."""
    found = fit(*task.first_half, task.gain)
    return Prediction(found.predict(task.command), asdict(found))
