"""Predictions of the tip where it was last seen some rows ago; none uses what comes later."""

from dataclasses import dataclass

import numpy as np
from continuum.robot import (
    MODEL_ERROR,
    TENDONS,
    Floats,
    Record,
    Robot,
    tip_jacobian,
    tip_of_bends,
)
from tautscope import Config, HysteresisReduction
from tautscope.config import DofEntry, EstimationConfig, SafetyConfig
from tautscope.loop.safety import Reaction

TICKS = 4
"""Control ticks per row. The record is quasi-static, so the loop runs on a clock of its own."""
WIDTH_LIMIT = 0.1
"""Largest slack of a bending angle [rad]."""
EXPECTED = 2 / 3
"""Of it, the width that is expected without another setting."""
WITHOUT = 0.02
"""Share of it that is left of the slack in a filter without plays."""
POSITION_DEVIATION = 1e-3
"""Of the motion capture, with what changes from row to row [m]."""
OFFSET_DEVIATION = 0.8
"""Of the filter [units]; its other settings are the package's."""
NO_OUTLIERS = 50.0
"""Distance of an outlier: motion capture has none, and an error of the model is not one."""
PULL = 5.0
"""Of a tendon, as a unit of the regressors [mm]."""
COEFFICIENTS, CORRECTIONS = 0.05, 5e-3
"""Standard deviations of the coefficients of a regression of the tip, and of a correction [m]."""


Case = tuple[str, int]
"""Model and rows since the tip was seen."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """Predicted tips.

    Attributes:
        tip: (n, 3) in the robot's frame, NaN where there is none [m].
        refused: Measurements that the loop did not use, and rows in which it held its estimate.
    """

    tip: Floats
    refused: int = 0


def linear(pulls: Floats) -> Floats:
    """Regressors (n, 10): 1 and the tendons."""
    return np.hstack([np.ones((len(pulls), 1)), pulls / PULL])


def products(pulls: Floats) -> Floats:
    """Regressors (n, 55): 1, the tendons, and their products with each other."""
    first, second = np.triu_indices(TENDONS)
    return np.hstack([linear(pulls), pulls[:, first] * pulls[:, second] / PULL**2])


def recursive_least_squares(regressors: Floats, values: Floats, std: float) -> Floats:
    """Coefficients (n + 1, m, 3) before and after each row, from a prior of 0 with a deviation."""
    count = regressors.shape[1]
    covariance = np.eye(count) * (std / MODEL_ERROR) ** 2
    found = np.zeros((len(values) + 1, count, values.shape[1]))
    for index, (row, value) in enumerate(zip(regressors, values, strict=True)):
        cross = covariance @ row
        gain = cross / (1.0 + row @ cross)
        found[index + 1] = found[index] + np.outer(gain, value - row @ found[index])
        covariance = covariance - np.outer(gain, cross)
    return found


def regression(regressors: Floats, values: Floats, delay: int, std: float) -> tuple[Floats, Floats]:
    """Values at each row, and at the row `delay` before, by what is known since that row."""
    known = recursive_least_squares(regressors, values, std)
    rows = np.arange(len(values))
    seen = np.maximum(rows - delay, 0)
    coefficients = known[np.where(rows < delay, 0, seen + 1)]
    now = np.einsum("nm,nmk->nk", regressors, coefficients)
    return now, np.einsum("nm,nmk->nk", regressors[seen], coefficients)


def from_last(tip: Floats, delay: int, now: Floats, then: Floats) -> Prediction:
    """The tip last seen, and by how much a model has moved since."""
    last = np.full_like(tip, np.nan)
    last[delay:] = tip[: len(tip) - delay]
    return Prediction(last + now - then)


def settings(share: float) -> Config:
    """The loop's configuration, with a share of the slack and all else alike."""
    # Lengths and travels of the filter are in units of the slack.
    default = EstimationConfig()
    lengths = {
        "offset_deviation": OFFSET_DEVIATION / share,
        "tip_deviation": default.tip_deviation / share,
        "weight_travel": default.weight_travel / share,
        "offset_travel": default.offset_travel / share,
    }
    estimation = EstimationConfig(outlier_distance=NO_OUTLIERS, **lengths)
    unusual = ("estimation.outlier_distance", *(f"estimation.{name}" for name in lengths))
    dofs = tuple(
        DofEntry(
            name=f"bend_{axis}_{segment}",
            width_limit=WIDTH_LIMIT,
            expected_width=share * EXPECTED * WIDTH_LIMIT,
            range=(-5.0, 5.0),
            speed=200.0,
        )
        for segment in (1, 2, 3)
        for axis in "xy"
    )
    return Config(
        dof=dofs,
        estimation=estimation,
        safety=SafetyConfig(
            frame_age=1.5, frame_gap=1.5, innovation_limit=NO_OUTLIERS, unusual=unusual
        ),
    )


def by_filter(
    robot: Robot, record: Record, delay: int, share: float, with_correction: bool
) -> Prediction:
    """The loop's predicted state, where each tip arrives `delay` rows late.

    Args:
        robot: Static model.
        record: Motion.
        delay: Rows since the tip was seen.
        share: Of the slack in the filter; 1, or `WITHOUT`.
        with_correction: Whether the static model's error is learned by regression on products. A
            measurement is corrected by what was known before it.

    Raises:
        RuntimeError: The loop limited the motion.
    """
    config = settings(share)
    loop = HysteresisReduction(config)
    loop.set_compensation(0.0)
    covariance = POSITION_DEVIATION**2 * np.eye(3)

    def position(bends: Floats) -> Floats:
        return np.asarray(tip_of_bends(bends[None], *robot.lengths)[0])

    def jacobian(bends: Floats) -> Floats:
        return tip_jacobian(bends, *robot.lengths)

    measured = robot.to_base(record.tip)
    before = now = np.zeros_like(measured)
    if with_correction:
        regressors = products(robot.taut(record.servos))
        error = measured - robot.tip(record.servos)
        before, _ = regression(regressors, error, 1, CORRECTIONS)
        now, _ = regression(regressors, error, delay, CORRECTIONS)
    found, refused = np.full_like(measured, np.nan), 0
    commands, period = robot.bends(record.servos), TICKS * config.control.period
    last = commands[0]
    loop.step(last, 0.0)
    for row, command in enumerate(commands):
        for tick in range(1, TICKS + 1) if row else ():
            share_of_row = tick / TICKS
            reference = last + share_of_row * (command - last)
            sent = loop.step(reference, (row - 1 + share_of_row) * period)
            if not np.allclose(sent, reference, atol=1e-9):
                raise RuntimeError(f"row {row}: the loop sent {sent} in place of {reference}")
        last, seen = command, row - delay
        if seen < 0:
            continue
        report = loop.on_measurement(
            measured[seen] - before[seen], seen * period, covariance, position, jacobian=jacobian
        )
        is_used = report.status in ("ok", "held", "partial")
        refused += not is_used or report.reaction.rank > Reaction.WARN.rank
        found[row] = position(loop.predicted_state) + now[row]
    return Prediction(found, refused)


def by_static_model(robot: Robot, record: Record, delay: int, with_correction: bool) -> Prediction:
    """The tip last seen, and by how much the static model has moved since."""
    measured, model = robot.to_base(record.tip), robot.tip(record.servos)
    now, then = model, model[np.maximum(np.arange(len(model)) - delay, 0)]
    if with_correction:
        regressors = products(robot.taut(record.servos))
        change = regression(regressors, measured - model, delay, CORRECTIONS)
        now, then = now + change[0], then + change[1]
    return from_last(measured, delay, now, then)


def by_regression(
    robot: Robot, record: Record, delay: int, regressors: Floats | None
) -> Prediction:
    """The tip last seen, and by how much a regression has moved since, if there is one."""
    measured = robot.to_base(record.tip)
    if regressors is None:
        return from_last(measured, delay, measured * 0, measured * 0)
    return from_last(measured, delay, *regression(regressors, measured, delay, COEFFICIENTS))


def predict(robot: Robot, record: Record, model: str, delay: int) -> Prediction:
    """The prediction of a model of `MODELS`."""
    servos = record.servos
    match model:
        case "last tip":
            return by_regression(robot, record, delay, None)
        case "linear":
            return by_regression(robot, record, delay, linear(servos))
        case "products":
            return by_regression(robot, record, delay, products(servos))
        case "products of taut tendons":
            return by_regression(robot, record, delay, products(robot.taut(servos)))
    corrected = "correction" in model
    if "filter" not in model:
        return by_static_model(robot, record, delay, corrected)
    share = WITHOUT if "without plays" in model else 1.0
    return by_filter(robot, record, delay, share, corrected)


def predict_case(job: tuple[Robot, Record, Case]) -> Prediction:
    """The prediction of a case."""
    robot, record, (model, delay) = job
    return predict(robot, record, model, delay)


MODELS = (
    "last tip",
    "linear",
    "products",
    "products of taut tendons",
    "kinematics",
    "kinematics, filter without plays",
    "kinematics, filter",
    "kinematics with correction",
    "kinematics with correction, filter without plays",
    "kinematics with correction, filter",
)
"""All but the filters predict the tip last seen, and by how much the model has moved since."""
