"""Rows of the hysteresis benchmark from the values of every seed, and tables from rows."""

import json
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np
from hysteresis.goals import CONDITIONS, GOALS
from tautscope.dof import Dof

Row = dict[str, Any]
Values = Mapping[tuple[str, Dof, str], Mapping[int, float]]
"""Quantity, DOF, name of the configuration: value per seed, as displayed; NaN if unknown."""

POINTS = 0.03
"""Largest distance of the worst seed from the median for a share to count as steady."""


WITHOUT_GOAL = (
    "operator: tracking error",
    "operator: bound of the reduction",
    "disturbed operator: largest error",
)
"""Quantities in the table of the page that have no goal; `--json` has all."""


def pair(by_seed: Values) -> Values:
    """Add the ratios of profile `best` to profile `paper`, seed by seed."""
    ratios = {}
    for what, goal in GOALS.items():
        for dof in Dof:
            best = by_seed.get((goal.paired or "", dof, "best"), {})
            paper = by_seed.get((goal.paired or "", dof, "paper"), {})
            if common := best.keys() & paper.keys():
                ratios[what, dof, "best"] = {seed: best[seed] / paper[seed] for seed in common}
    return {**by_seed, **ratios}


def to_rows(by_seed: Values) -> list[Row]:
    """Return a row per quantity, DOF and configuration, in the order of `GOALS`.

    An unknown value counts as worse than any other and is shown as None. `holds`: the median
    reaches the goal. `steady`: the worst seed is within 3 points of the median.
    """
    order = list(GOALS)
    rows = []
    for what, dof, name in sorted(by_seed, key=lambda key: (order.index(key[0]), key[1])):
        goal = GOALS[what]
        limit = goal.limit(dof)
        unknown = np.inf if goal.sense == "max" else -np.inf
        values = [unknown if np.isnan(each) else each for each in by_seed[what, dof, name].values()]
        middle, worst = median(values), max(values) if goal.sense == "max" else min(values)
        rows.append(
            {
                "what": what,
                "dof": dof.label,
                "profile": name,
                "unit": dof.display_unit if goal.unit == "tip" else goal.unit,
                "median": middle if np.isfinite(middle) else None,
                "worst": worst if np.isfinite(worst) else None,
                "n": len(values),
                "goal": limit,
                "sense": goal.sense,
                "holds": _holds(limit, goal.sense, middle),
                "steady": bool(abs(worst - middle) <= POINTS) if goal.unit == "share" else None,
            }
        )
    return rows


def _holds(limit: float | None, sense: str, value: float) -> bool | None:
    if limit is None:
        return None
    rounding = 1e-9 * abs(limit)
    return bool(value <= limit + rounding if sense == "max" else value >= limit - rounding)


def to_json(rows: Sequence[Row], **facts: Any) -> str:
    """Return JSON: rows with a goal in `rows`, the others in `without_goal`."""
    document = {
        "rows": [row for row in rows if row["goal"] is not None],
        "without_goal": [row for row in rows if row["goal"] is None],
    }
    return json.dumps(document | facts, allow_nan=False)


def show(value: float | None, unit: str) -> str:
    """Format a value for a table."""
    if value is None:
        return "none"
    if unit == "share":
        return f"{100 * value:.1f} %"
    return f"{value:.0f}" if unit in ("periods", "strokes") else f"{value:.3g}"


def goal(row: Row) -> str:
    """Format the goal of a row and whether it is reached."""
    if row["goal"] is None:
        return ""
    bound = "at least" if row["sense"] == "min" else "at most"
    verdict = "holds" if row["holds"] else "missed"
    return f"{bound} {show(row['goal'], row['unit']).replace('.0 %', ' %')}, {verdict}"


def plain(rows: Sequence[Row]) -> str:
    """Return a line per row, for a terminal."""
    head = f"{'what':<54}{'dof':<11}{'profile':<9}{'median':>9}{'worst':>9}  {'unit':<9}goal"
    lines = [head]
    for row in rows:
        median_, worst = (show(row[key], row["unit"]) for key in ("median", "worst"))
        wide = ", worst more than 3 points off" if row["steady"] is False else ""
        lines.append(
            f"{row['what']:<54}{row['dof']:<11}{row['profile']:<9}{median_:>9}{worst:>9}  "
            f"{row['unit']:<9}{goal(row)}{wide}"
        )
    return "\n".join(lines)


def full(rows: Sequence[Row]) -> str:
    """Return a Markdown table: a line per quantity with a goal, or of `WITHOUT_GOAL`."""
    cells: dict[str, dict[str, list[Row]]] = {}
    for row in rows:
        cells.setdefault(row["what"], {}).setdefault(row["profile"], []).append(row)
    conditions = [cells.pop(f"{name}: change of reduction", {}) for name in CONDITIONS]
    if any(conditions):
        every = [found["best"] for found in conditions if found]
        cells[f"{len(every)} image conditions: largest change of reduction"] = {
            "best": [max(own, key=_distance) for own in zip(*every, strict=True)]
        }
    lines = ["| what | `best` | `paper`, median | goal |", "|---|---|---|---|"]
    for what, mine in cells.items():
        goals = _goals(mine.get("best", ()))
        if not goals and what not in WITHOUT_GOAL:
            continue
        shown = [_triple(mine.get("best", ())), _triple(mine.get("paper", ()), has_worst=False)]
        units = {
            unit: None for row in next(iter(mine.values())) if (unit := row["unit"]) != "share"
        }
        title = what + (f" [{', '.join(units)}]" if units else "")
        lines.append(f"| {title} | {shown[0]} | {shown[1]} | {goals} |")
    return "\n".join(lines)


def _distance(row: Row) -> float:
    return float("inf") if row["median"] is None else row["median"]


def _triple(rows: Sequence[Row], has_worst: bool = True) -> str:
    """Medians and worst values of the DOFs of a quantity."""
    median_, worst = (
        " / ".join(show(row[key], row["unit"]).removesuffix(" %") for row in rows)
        for key in ("median", "worst")
    )
    spread = f"{median_} ({worst})" if has_worst else median_
    return spread + (" %" if rows[0]["unit"] == "share" else "") if rows else ""


def _goals(rows: Sequence[Row]) -> str:
    """The goal of a quantity, and the DOFs that miss it."""
    limits = [row["goal"] for row in rows]
    if not limits or limits[0] is None:
        return ""
    if len(set(limits)) == 1:
        del limits[1:]
    bound = "at least" if rows[0]["sense"] == "min" else "at most"
    unit = rows[0]["unit"]
    text = " / ".join(show(limit, unit).removesuffix(" %").removesuffix(".0") for limit in limits)
    missed = ", ".join(row["dof"] for row in rows if not row["holds"])
    return (
        f"{bound} {text}"
        + (" %" if unit == "share" else "")
        + (f"; missed: {missed}" if missed else "")
    )
