"""The models that `tautscope analyze` compares, in the order of its table."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

from tautscope.analysis.models import (
    bouc_wen,
    constant_play,
    last_tip,
    linear_fit,
    mixture,
    online,
    prandtl_ishlinskii,
)
from tautscope.analysis.models.task import Prediction, Task


@dataclass(frozen=True)
class Model:
    """A model of the comparison.

    Attributes:
        name: Name in files and JSON.
        title: Name in tables and figures.
        fitted_to: The part of the record its parameters are from. "on-line": they are updated with
            each sample after that sample has been predicted.
        run: Fits the model and predicts the record.
        uses_sights: Whether a prediction uses the tips before it; otherwise only the command.
    """

    name: str
    title: str
    fitted_to: Literal["whole record", "first half", "on-line"]
    run: Callable[[Task], Prediction]
    uses_sights: bool


LINEAR_FIT = Model("none", "linear fit", "first half", linear_fit.run, False)
MODELS = (
    Model("last_tip", "last tip", "on-line", last_tip.run, True),
    Model("last_tip_gain", "last tip + gain", "first half", last_tip.run_with_gain, True),
    LINEAR_FIT,
    Model("play", "constant play", "whole record", constant_play.run, False),
    Model("prandtl_ishlinskii", "Prandtl-Ishlinskii", "first half", prandtl_ishlinskii.run, False),
    Model("bouc_wen", "Bouc-Wen", "first half", bouc_wen.run, False),
    Model(
        "paper", "article's estimator", "on-line", partial(online.predict, make=online.paper), True
    ),
    Model(
        "filter", "fixed plays", "on-line", partial(online.predict, make=online.fixed_plays), True
    ),
    Model("best", "weighted mixture", "on-line", mixture.run, True),
)
