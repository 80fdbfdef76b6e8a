"""Rows of Table 1 and of the table of the operator motion: title, meaning and goal of a figure."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, Literal

from tautscope.dof import Dof, NamedDof

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


@dataclass(frozen=True, slots=True)
class Row:
    """One row of a table: what a field of `DofResult` or `OperatorResult` is.

    Attributes:
        title: Title in printed tables.
        meaning: What it is, in a sentence for a reader who has seen nothing else.
        kind: ``length`` is in the DOF's unit, ``share`` is printed in percent, ``number`` and
            ``count`` have no conversion.
        goal: Limit for profile ``best`` on the twin, of all DOFs or of each [m or rad, fraction];
            the goals of docs/hysteresis.md.
        name: Of the field.
    """

    title: str
    meaning: str
    kind: Literal["length", "share", "number", "count"] = "length"
    goal: float | tuple[float, float, float] | None = None
    name: str = ""

    def limit(self, dof: NamedDof) -> float | None:
        """The goal of one DOF; another robot has none."""
        if not isinstance(dof, Dof):
            return None
        return self.goal[dof] if isinstance(self.goal, tuple) else self.goal

    @property
    def worst(self) -> Literal["min", "max"]:
        """Whether the smallest value is the worst and a goal a lower limit, or the reverse."""
        return "min" if self.kind == "share" else "max"

    def is_missed(self, dof: NamedDof, value: float) -> bool:
        """Whether there is a goal that a value, perhaps an unknown one, does not meet."""
        limit = self.limit(dof)
        if limit is None:
            return False
        rounding = 1e-9 * limit
        is_met = value <= limit + rounding if self.worst == "max" else value >= limit - rounding
        return not is_met


def figure(*args: Any, **options: Any) -> Any:
    """A field of a dataclass of figures, with its `Row`, whose arguments these are."""
    return field(metadata={"row": Row(*args, **options)})


def rows_of(figures: type[DataclassInstance]) -> tuple[Row, ...]:
    """The rows of a dataclass of figures, in the order of its fields."""
    return tuple(replace(each.metadata["row"], name=each.name) for each in fields(figures))


ARTICLE: dict[str, dict[NamedDof, float]] = {
    "uncompensated": {Dof.INSERTION: 10e-3, Dof.ROTATION: 1.8, Dof.BENDING: 1.1},
    "compensated": {Dof.INSERTION: 2.5e-3, Dof.ROTATION: 0.4, Dof.BENDING: 0.3},
    "reduction": {Dof.INSERTION: 0.75, Dof.ROTATION: 0.78, Dof.BENDING: 0.73},
}
"""Table 1 of the article [m or rad, fraction]."""
