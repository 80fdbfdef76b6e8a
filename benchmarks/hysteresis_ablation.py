"""What each idea of profile `best` earns: the profile without it, row by row.

`IDEAS` is the list. To add one, give it a name and the overrides that take it away.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hysteresis_table import Row, show

IDEAS: dict[str, dict[str, Any]] = {
    "lead made up in contact": {"adaptive.contact_gain": 1.0, "adaptive.cautious_gain": 1.0},
    "caution where an offset is hardly known": {"adaptive.cautious_deviation": 1e6},
    "lower gain where an offset is hardly known": {"adaptive.cautious_gain": 2.0},
    "gain that falls before the contact": {"adaptive.taper": 1e-3},
    "gain that falls as the lead arrives": {"adaptive.settling": 1e-3},
    "tremor told from intention": {"adaptive.tremor_time": 0.0},
    "offsets that adapt": {"adaptive.level_deviation": 1e-3, "adaptive.local_deviation": 0.0},
    "offsets over position": {"adaptive.local_deviation": 0.0, "adaptive.local_drift": 0.0},
    "offsets that drift": {"adaptive.level_drift": 0.0, "adaptive.local_drift": 0.0},
    "offsets that mirror each other": {"adaptive.symmetry": 0.0},
    "contact needs a slope near 1": {"adaptive.slope_tolerance": 0.99},
    "contact needs a tip that has moved": {"adaptive.contact_moved": 0.0},
    "play state corrected by images": {"adaptive.state_correction": 0.0},
    "more than one step, outliers left out": {
        "state_estimation.steps": 1,
        "state_estimation.outlier_distance": 1e6,
    },
    "a gain taken as known (0.3 instead)": {"adaptive.gain_deviation": 0.3},
}
"""The idea, and the configuration of the profile without it."""

WORTH = {"share": 0.01, "periods": 0.5, "strokes": 0.5}
"""A change for the worse below this is not told, by unit; of other units, 5 % of the goal
or, where there is none, of the profile's figure."""


def compare(rows: Sequence[Row]) -> list[Row]:
    """One row per idea, figure and DOF: the profile with it, without it, and how much worse.

    `worse` is positive where the idea helps, in the row's unit; None where one is not known.
    """
    whole = {(row["what"], row["dof"]): row for row in rows if row["profile"] == "best"}
    found = []
    for row in rows:
        if row["profile"] not in IDEAS:
            continue
        best = whole[row["what"], row["dof"]]
        known = row["median"] is not None and best["median"] is not None
        sign = 1 if row["sense"] == "max" else -1
        found.append(
            {key: row[key] for key in ("what", "dof", "unit", "n", "goal", "sense")}
            | {
                "idea": row["profile"],
                "best": best["median"],
                "without": row["median"],
                "worse": sign * (row["median"] - best["median"]) if known else None,
                "held": best["holds"],
                "holds": row["holds"],
            }
        )
    return found


def matters(row: Row) -> bool:
    """Whether taking the idea away made this figure notably worse."""
    if row["worse"] is None:
        return row["without"] is None
    usual = row["best"] if row["goal"] is None else row["goal"]
    return bool(row["worse"] >= WORTH.get(row["unit"], 0.05 * usual))


def table(losses: Sequence[Row]) -> str:
    """Markdown: per idea the figures that get worse without it."""
    lines = ["| without | what gets worse | DOF | `best` | without |", "|---|---|---|---|---|"]
    for idea in dict.fromkeys(row["idea"] for row in losses):
        mine = [row for row in losses if row["idea"] == idea and matters(row)]
        if not mine:
            lines.append(f"| {idea} | nothing | | | |")
        for row in mine:
            best, without = (show(row[key], row["unit"]) for key in ("best", "without"))
            missed = " (goal lost)" if row["held"] and not row["holds"] else ""
            lines.append(f"| {idea} | {row['what']} | {row['dof']} | {best} | {without}{missed} |")
    return "\n".join(lines)
