"""Estimators that learn while the record goes by, Eqs. (4)-(6) among them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from tautscope._core import AdaptiveAxis, Estimator
from tautscope.analysis.models import constant_play
from tautscope.analysis.models.task import Floats, Prediction, Task, seen
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.construction import build_adaptive_axis

UPDATE_SHARE = 0.01
"""Update distance, as a share of the command's range in the first half, if none is given."""


class OnlineEstimator(Protocol):
    """What `predict` needs: an estimator whose input has the tip's unit and direction."""

    def run(self, commands: Floats, measured: Floats) -> tuple[Floats, Floats, Floats]:
        """Predicted tip, delta_minus and delta_plus, (n,) each, without a look ahead.

        `predicted[k]` uses `commands[:k + 1]` and `measured[:k]`; the offsets are those after
        sample k. A NaN in `measured` teaches nothing.
        """


Make = Callable[[Config, float], OnlineEstimator]
"""From a configuration and update distance [tip's unit] to a fresh estimator."""


@dataclass(frozen=True)
class InputScale:
    """Puts the command into the tip's unit: gain * command + offset.

    Attributes:
        gain: Tip's unit per command's unit.
        offset: [tip's unit].
        used: Samples it was found from; nothing is predicted for them.
    """

    gain: float
    offset: float
    used: int


def input_scale(task: Task) -> InputScale:
    """Gain and offset an on-line estimator starts with.

    A given gain needs the first tip seen, for the offset. Without one, gain and offset are those
    of a constant play fitted to the first half: the calibration stretch, which does not count.
    """
    if task.gain is None:
        play = constant_play.fit(*task.first_half)
        return InputScale(play.gain, -(play.delta_minus + play.delta_plus) / 2, task.half)
    first = int(np.flatnonzero(seen(task.measured))[0])
    offset = float(task.measured[first] - task.gain * task.command[first])
    return InputScale(task.gain, offset, first + 1)


def predict(task: Task, make: Make) -> Prediction:
    """Run an estimator over the record; it goes through the calibration stretch as well.

    Offsets are reported against gain * command, whose zero is the command's own.
    """
    scale = input_scale(task)
    distance = task.update_distance
    if distance is None:
        distance = UPDATE_SHARE * abs(scale.gain) * float(np.ptp(task.first_half[0]))
    estimator = make(task.config, distance)
    scaled = scale.gain * task.command + scale.offset
    tip, minus, plus = estimator.run(scaled, task.measured)
    tip[: scale.used] = np.nan
    minus, plus = minus - scale.offset, plus - scale.offset
    parameters = {
        "gain": scale.gain,
        "update_distance": distance,
        "delta_minus": float(minus[-1]),
        "delta_plus": float(plus[-1]),
        "width": float(plus[-1] - minus[-1]),
    }
    return Prediction(tip, parameters, {"delta_minus": minus, "delta_plus": plus})


def paper(config: Config, update_distance: float) -> OnlineEstimator:
    """The article's estimator, offsets 0 at the start."""
    settings = config.insertion
    return Estimator(
        update_distance=update_distance,
        contact_tolerance=settings.contact_tolerance,
        smoothing_factor=settings.smoothing_factor,
        delta_minus=0.0,
        delta_plus=0.0,
    )


def best(config: Config, update_distance: float) -> OnlineEstimator:
    """That of profile ``best``: offsets over position, and a play state corrected by the tip."""
    unit = config.replace(**{"insertion.update_distance": update_distance})
    return _Adaptive(build_adaptive_axis(unit, Dof.INSERTION, compensate=False))


@dataclass(frozen=True)
class _Adaptive:
    """An axis of profile ``best`` that follows the commands of a record and leads none of them."""

    axis: AdaptiveAxis

    def run(self, commands: Floats, measured: Floats) -> tuple[Floats, Floats, Floats]:
        """As `OnlineEstimator.run`; what is measured has `adaptive.model_deviation`."""
        found = np.empty((3, len(commands)))
        axis, nothing = self.axis, np.empty(0)
        for k, (command, tip) in enumerate(zip(commands.tolist(), measured.tolist(), strict=True)):
            axis.step(command)
            found[0, k] = axis.predicted_state
            axis.learn(command, tip, 0.0, nothing)
            found[1:, k] = axis.delta_minus, axis.delta_plus
        predicted, delta_minus, delta_plus = found
        return predicted, delta_minus, delta_plus
