"""From the figures of every seed to rows, and from rows to text."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

import numpy as np
from hysteresis_goals import CONDITIONS, GOALS, LATENCIES, Goal
from tautscope.dof import Dof

Row = dict[str, Any]
Figures = Mapping[tuple[str, Dof, str], Mapping[int, float]]
"""What, DOF, name of the configuration: figure per seed in the unit shown; NaN where none is."""

POINTS = 0.03
"""How far the worst seed may be from the median for a share to count as steady."""

SHORT: dict[str, tuple[str, ...]] = {
    "reduction of mean width": ("reduction of mean width",),
    "reduction of max width": ("reduction of max width",),
    "tip overspeed, times the hand's": ("tip overspeed",),
    "start [periods]": ("start",),
    "three DOFs at once: reduction": ("three DOFs at once: reduction",),
    "width 10-2-10 mm: overshoot [mm]": ("width 10-2-10 mm: overshoot",),
    "strokes until within 10 %": ("width 10-2-10 mm: strokes until within 10 %",),
    "start value 50 % too wide: overshoot [mm]": ("start 50 % too wide: overshoot",),
    "latency 0 or 200 ms: change": tuple(
        f"latency {name}: change of reduction" for name in LATENCIES
    ),
    "tremor 2 mm at rest: motor [mm]": ("tremor at rest: motor",),
    "tremor 2 mm at rest: tip [mm]": ("tremor at rest: tip",),
    f"worst of {len(CONDITIONS)} image conditions: change": tuple(
        f"{name}: change of reduction" for name in CONDITIONS
    ),
}
"""The rows of the README, and the figures of which each shows the least good."""


def pair(figures: Figures) -> Figures:
    """With the figures that are profile `best`'s over profile `paper`'s, seed by seed."""
    ratios = {}
    for what, goal in GOALS.items():
        for dof in Dof:
            best = figures.get((goal.paired or "", dof, "best"), {})
            paper = figures.get((goal.paired or "", dof, "paper"), {})
            if common := best.keys() & paper.keys():
                ratios[what, dof, "best"] = {seed: best[seed] / paper[seed] for seed in common}
    return {**figures, **ratios}


def to_rows(figures: Figures) -> list[Row]:
    """One row per figure, DOF and configuration, in the order of `GOALS`.

    A figure that is not known counts as worse than any other; None stands for it. `holds` asks
    the median for the goal, `steady` the worst seed to be within 3 points of it.
    """
    order = list(GOALS)
    rows = []
    for what, dof, name in sorted(figures, key=lambda key: (order.index(key[0]), key[1])):
        goal = GOALS[what]
        lost = np.inf if goal.sense == "max" else -np.inf
        values = [lost if np.isnan(each) else each for each in figures[what, dof, name].values()]
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
                "goal": goal.value,
                "sense": goal.sense,
                "holds": _holds(goal, middle),
                "steady": bool(abs(worst - middle) <= POINTS) if goal.unit == "share" else None,
            }
        )
    return rows


def _holds(goal: Goal, value: float) -> bool | None:
    if goal.value is None:
        return None
    slack = 1e-9 * abs(goal.value)  # of rounding
    return bool(value <= goal.value + slack if goal.sense == "max" else value >= goal.value - slack)


def to_json(rows: Sequence[Row], **facts: Any) -> str:
    """Rows with a goal as `rows`, the others as `without_goal`."""
    document = {
        "rows": [row for row in rows if row["goal"] is not None],
        "without_goal": [row for row in rows if row["goal"] is None],
    }
    return json.dumps(document | facts, allow_nan=False)


def show(value: float | None, unit: str) -> str:
    """A figure for people."""
    if value is None:
        return "none"
    if unit == "share":
        return f"{100 * value:.1f} %"
    return f"{value:.0f}" if unit in ("periods", "strokes") else f"{value:.3g}"


def goal(row: Row) -> str:
    """A row's goal and whether it is reached."""
    if row["goal"] is None:
        return ""
    bound = "at least" if row["sense"] == "min" else "at most"
    verdict = "holds" if row["holds"] else "missed"
    return f"{bound} {show(row['goal'], row['unit']).replace('.0 %', ' %')}, {verdict}"


def plain(rows: Sequence[Row]) -> str:
    """A line per row, for a terminal."""
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
    """Markdown: both profiles side by side, every row."""
    lines = ["| what | DOF | `paper` | `best` | goal |", "|---|---|---|---|---|"]
    cells: dict[tuple[str, str], dict[str, Row]] = {}
    for row in rows:
        cells.setdefault((row["what"], row["dof"]), {})[row["profile"]] = row
    for (what, dof), mine in cells.items():
        shown = []
        for name in ("paper", "best"):
            if name in mine:
                unit, steady = mine[name]["unit"], mine[name]["steady"]
                figures = (show(mine[name][key], unit) for key in ("median", "worst"))
                shown.append("{} ({})".format(*figures) + (" (!)" if steady is False else ""))
            else:
                shown.append("")
        last = mine.get("best") or mine["paper"]
        unit = "" if last["unit"] == "share" else f" [{last['unit']}]"
        lines.append(f"| {what}{unit} | {dof} | {shown[0]} | {shown[1]} | {goal(last)} |")
    return "\n".join(lines)


def short(rows: Sequence[Row]) -> str:
    """Markdown for the README: medians, DOF by DOF where there are three."""
    lines = ["| | `paper` | `best` | goal |", "|---|---|---|---|"]
    for label, whats in SHORT.items():
        cells = {name: _least_good(rows, whats, name) for name in ("paper", "best")}
        some = cells["best"] or cells["paper"]
        if not some:
            continue
        bound = "at least" if some[0]["sense"] == "min" else "at most"
        target = show(some[0]["goal"], some[0]["unit"]).replace(".0 %", " %")
        lines.append(
            f"| {label} | {_cell(cells['paper'])} | {_cell(cells['best'])} "
            f"| {bound} {target}{_missed(cells['best'])} |"
        )
    return "\n".join(lines)


def _missed(rows: Sequence[Row]) -> str:
    """The DOFs whose goal is not reached."""
    names = [row["dof"] for row in rows if not row["holds"]]
    return f"; missed in {', '.join(names)}" if names else ""


def _least_good(rows: Sequence[Row], whats: Sequence[str], name: str) -> list[Row]:
    """Per DOF the row with the least good median."""
    found = []
    for dof in Dof:
        mine = [
            row
            for row in rows
            if row["what"] in whats and row["dof"] == dof.label and row["profile"] == name
        ]
        if mine:
            bad = [np.inf if row["median"] is None else _badness(row) for row in mine]
            found.append(mine[int(np.argmax(bad))])
    return found


def _badness(row: Row) -> float:
    return float(row["median"] if row["sense"] == "max" else -row["median"])


def _cell(rows: Sequence[Row]) -> str:
    texts = [show(row["median"], row["unit"]) for row in rows]
    if all(text.endswith(" %") for text in texts) and texts:
        return ", ".join(text.removesuffix(" %") for text in texts) + " %"
    return ", ".join(texts)
