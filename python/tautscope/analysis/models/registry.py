"""The models that `tautscope analyze` compares, in the order of its table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

from tautscope.analysis.models import (
    bouc_wen,
    constant_play,
    linear_fit,
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
    """

    name: str
    title: str
    fitted_to: Literal["whole record", "first half", "on-line"]
    run: Callable[[Task], Prediction]


LINEAR_FIT = Model("none", "linear fit", "first half", linear_fit.run)
MODELS = (
    LINEAR_FIT,
    Model("play", "constant play", "whole record", constant_play.run),
    Model("prandtl_ishlinskii", "Prandtl-Ishlinskii", "first half", prandtl_ishlinskii.run),
    Model("bouc_wen", "Bouc-Wen", "first half", bouc_wen.run),
    Model("paper", "article's estimator", "on-line", partial(online.predict, make=online.paper)),
    Model("best", "profile best", "on-line", partial(online.predict, make=online.best)),
)
