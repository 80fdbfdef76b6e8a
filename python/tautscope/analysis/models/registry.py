"""The models `tautscope analyze` compares, in the order of its table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

from tautscope.analysis.models import (
    bouc_wen,
    constant_play,
    online,
    prandtl_ishlinskii,
    straight_line,
)
from tautscope.analysis.models.task import Prediction, Task


@dataclass(frozen=True)
class Model:
    """One entry.

    Attributes:
        name: In files and JSON.
        title: In tables and figures.
        learns: What of the record it sees before the second half is scored. "on-line" sees each
            sample of the second half after it has predicted it, the others' parameters are fixed.
        run: The work.
    """

    name: str
    title: str
    learns: Literal["whole record", "first half", "on-line"]
    run: Callable[[Task], Prediction]


NO_MODEL = Model("none", "no model", "first half", straight_line.run)
MODELS = (
    NO_MODEL,
    Model("play", "constant play", "whole record", constant_play.run),
    Model("prandtl_ishlinskii", "Prandtl-Ishlinskii", "first half", prandtl_ishlinskii.run),
    Model("bouc_wen", "Bouc-Wen", "first half", bouc_wen.run),
    Model("paper", "article's estimator", "on-line", partial(online.predict, make=online.paper)),
    Model("best", "profile best", "on-line", partial(online.predict, make=online.best)),
)
