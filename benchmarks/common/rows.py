"""Rows of the output: one quantity with its goal."""

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any


def goal_row(
    what: str,
    unit: str,
    values: Sequence[float],
    goal: float,
    sense: str = "max",
    *,
    dof: str | None = None,
    profile: str | None = None,
    n: int | None = None,
) -> dict[str, Any]:
    """Return the row of one quantity; the goal applies to the median.

    Args:
        what: Quantity.
        unit: Its unit.
        values: One value per repetition or seed.
        goal: Limit, in the same unit.
        sense: Whether the goal is an upper ("max") or a lower ("min") limit.
        dof: Degree of freedom, if the quantity belongs to one.
        profile: Configuration, estimator or image that was measured.
        n: Number of samples, where it differs from the number of values.
    """
    middle = median(values)
    return {
        "what": what,
        "dof": dof,
        "profile": profile,
        "unit": unit,
        "median": middle,
        "worst": max(values) if sense == "max" else min(values),
        "n": len(values) if n is None else n,
        "goal": goal,
        "sense": sense,
        "holds": bool(middle <= goal if sense == "max" else middle >= goal),
    }


def outcome_rows(found: Mapping[Any, Any]) -> list[dict[str, Any]]:
    """Return a row per job, for `json.dumps`; dataclasses need its `default=asdict`."""
    return [{"job": job, "outcome": outcome} for job, outcome in found.items()]


def print_rows(rows: Sequence[dict[str, Any]]) -> None:
    """Print rows as a table for a terminal."""
    print(f"{'what':<34}{'profile':<18}{'median':>10}{'worst':>10}  unit         goal")
    for row in rows:
        name, values = row["profile"] or "", f"{row['median']:>10.5g}{row['worst']:>10.5g}"
        bound = "<=" if row["sense"] == "max" else ">="
        goal = f"{bound} {row['goal']:g}: {'holds' if row['holds'] else 'missed'}"
        print(f"{row['what']:<34}{name:<18}{values}  {row['unit']:<12} {goal}")
