"""Ablation: profile `best` without one of its ideas at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hysteresis.tables import Row, show

IDEAS: dict[str, dict[str, Any]] = {
    "bound of the predicted tip's speed": {"law.tip_gain": 50.0},
    "rate limit of the estimate in use": {
        "law.change_rate": 1e9,
        "safety.unusual": ["law.change_rate"],
    },
    "offset that images measure": {"estimation.offset_deviation": 0.0},
    "deviation of the tip from the plays": {
        "estimation.tip_deviation": 1e-3,
        "safety.unusual": ["estimation.tip_deviation"],
    },
    "weights that change": {
        "estimation.weight_travel": 1e9,
        "safety.unusual": ["estimation.weight_travel"],
    },
    "uneven curvature": {"estimation.shape_deviation": 0.0},
    "shift of the image": {"estimation.image_deviation": 0.0},
    "errors of the features that are alike": {"estimation.misfit_deviation": 0.0},
    "rejection of a marker": {
        "estimation.outlier_distance": 1e6,
        "safety.unusual": ["estimation.outlier_distance"],
    },
}
"""Name of each idea, and the configuration changes that disable it."""

NOTABLE = {"share": 0.01, "periods": 0.5, "strokes": 0.5}
"""Smallest loss that the table shows, by unit; otherwise 5 % of the goal, or of the value of
the profile where there is no goal."""


def compare(rows: Sequence[Row]) -> list[Row]:
    """Return a row per idea, quantity and DOF: the profile with the idea, without it, and the loss.

    `worse` is positive where the idea helps, in the unit of the row; None if a value is unknown.
    """
    whole = {(row["what"], row["dof"]): row for row in rows if row["profile"] == "best"}
    found = []
    for row in rows:
        if row["profile"] not in IDEAS:
            continue
        best = whole[row["what"], row["dof"]]
        is_known = row["median"] is not None and best["median"] is not None
        sign = 1 if row["sense"] == "max" else -1
        found.append(
            {key: row[key] for key in ("what", "dof", "unit", "n", "goal", "sense")}
            | {
                "idea": row["profile"],
                "best": best["median"],
                "without": row["median"],
                "worse": sign * (row["median"] - best["median"]) if is_known else None,
                "held": best["holds"],
                "holds": row["holds"],
            }
        )
    return found


def is_notable(row: Row) -> bool:
    """Return whether the value is notably worse without the idea."""
    if row["worse"] is None:
        return row["without"] is None
    scale = row["best"] if row["goal"] is None else row["goal"]
    return bool(row["worse"] >= NOTABLE.get(row["unit"], 0.05 * scale))


def table(losses: Sequence[Row]) -> str:
    """Return a Markdown table: for each idea, the quantities that get worse without it."""
    lines = ["| without | what gets worse | DOF | `best` | without |", "|---|---|---|---|---|"]
    for idea in dict.fromkeys(row["idea"] for row in losses):
        mine = [row for row in losses if row["idea"] == idea and is_notable(row)]
        if not mine:
            lines.append(f"| {idea} | nothing | | | |")
        for row in mine:
            best, without = (show(row[key], row["unit"]) for key in ("best", "without"))
            missed = " (goal lost)" if row["held"] and not row["holds"] else ""
            lines.append(f"| {idea} | {row['what']} | {row['dof']} | {best} | {without}{missed} |")
    return "\n".join(lines)
