"""On-line estimators: the article's, Eqs. (4)-(6), and that of profile ``best``."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from tautscope._core import Estimator, TipFilter
from tautscope.analysis.models import constant_play
from tautscope.analysis.models.task import Floats, Prediction, Task
from tautscope.config import Config
from tautscope.errors import RecordError
from tautscope.loop.construction import core_settings

UPDATE_SHARE = 0.01
"""Default update distance, as a share of the command's range in the first half."""
TASKS = 8
"""Tasks whose results several models share: a record, and the same with sights only."""

EXPECTED_WIDTH, TIP_STD = 48.0, 0.1
"""Width that the filter expects, about half of the command's range, and standard deviation of a
measured tip [in update distances]."""
RECORD = {
    "estimation.weight_deviation": 0.43,
    "estimation.offset_deviation": 1.0,
    "estimation.weight_travel": 300.0,
    "estimation.offset_travel": 50.0,
    "estimation.tip_deviation": 0.01,
}
"""Prior of a record: nothing is known of its slack, and its tip is measured directly."""


Make = Callable[[Config, float], Estimator | TipFilter]
"""Makes an estimator of a configuration and an update distance [tip's unit].

Its `run` gives predicted tip, delta_minus and delta_plus, (n,) each, for commands in the tip's unit
and direction and measured tips, NaN where there is none. Sample k of the prediction uses the
commands up to k and the tips before k; the offsets are those after sample k.
"""


@dataclass(frozen=True)
class InputScale:
    """Conversion of the command into the tip's unit: gain * command + offset.

    Attributes:
        gain: Tip's unit per command's unit.
        offset: [tip's unit].
        used: Number of samples it was fitted to; they get no prediction.
    """

    gain: float
    offset: float
    used: int


@lru_cache(maxsize=TASKS)
def input_scale(task: Task) -> InputScale:
    """Gain and offset for an on-line estimator.

    If the gain is given, the first measured tip gives the offset. Otherwise both are those of a
    constant play fitted to the first half, which is not scored.

    Raises:
        RecordError: Its gain is 0.
    """
    if task.gain is None:
        play = constant_play.fit(*task.first_half)
        if play.gain == 0:
            found = "a tip that does not follow the command in the first half"
            raise RecordError("measured", found, "at least four strokes")
        return InputScale(play.gain, -(play.delta_minus + play.delta_plus) / 2, task.half)
    first = int(np.flatnonzero(np.isfinite(task.measured))[0])
    offset = float(task.measured[first] - task.gain * task.command[first])
    return InputScale(task.gain, offset, first + 1)


def predict(task: Task, make: Make) -> Prediction:
    """Run an estimator over the whole record.

    The contact offsets are relative to gain * command.
    """
    scale, tip, minus, plus = run_estimator(task, make)
    tip = np.where(np.arange(len(tip)) < scale.used, np.nan, tip)
    parameters = {
        "gain": scale.gain,
        "update_distance": update_distance(task, scale),
        "delta_minus": float(minus[-1]),
        "delta_plus": float(plus[-1]),
        "width": float(plus[-1] - minus[-1]),
    }
    return Prediction(tip, parameters, {"delta_minus": minus, "delta_plus": plus})


@lru_cache(maxsize=TASKS)
def run_estimator(task: Task, make: Make) -> tuple[InputScale, Floats, Floats, Floats]:
    """Scale of the input, and (n,) each: tip, delta_minus and delta_plus.

    The tip of the samples that the scale was fitted to is no prediction.
    """
    scale = input_scale(task)
    estimator = make(task.config, update_distance(task, scale))
    tip, minus, plus = estimator.run(scale.gain * task.command + scale.offset, task.measured)
    return scale, tip, minus - scale.offset, plus - scale.offset


def update_distance(task: Task, scale: InputScale) -> float:
    """Distance tau [tip's unit]: given, or `UPDATE_SHARE` of the scaled command's range."""
    if task.update_distance is not None:
        return task.update_distance
    return UPDATE_SHARE * abs(scale.gain) * float(np.ptp(task.first_half[0]))


def paper(config: Config, update_distance: float) -> Estimator:
    """The article's estimator; the offsets start at 0."""
    settings = config.insertion
    return Estimator(
        update_distance=update_distance,
        contact_tolerance=settings.contact_tolerance,
        smoothing_factor=settings.smoothing_factor,
        delta_minus=0.0,
        delta_plus=0.0,
    )


def fixed_plays(config: Config, update_distance: float) -> TipFilter:
    """The filter of profile ``best`` with the prior `RECORD`."""
    return TipFilter(
        core_settings(config.replace(**RECORD)),
        expected_width=EXPECTED_WIDTH * update_distance,
        std=TIP_STD * update_distance,
    )
