"""Ablation: profile `best` without one of its ideas at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hysteresis.tables import Row, show

IDEAS: dict[str, dict[str, Any]] = {
    "compensation completed in contact": {
        "adaptive.contact_gain": 1.0,
        "adaptive.cautious_gain": 1.0,
    },
    "cautious approach for uncertain offsets": {"adaptive.cautious_deviation": 1e6},
    "lower gain for uncertain offsets": {"adaptive.cautious_gain": 2.0},
    "gain taper before the contact": {"adaptive.taper": 1e-3},
    "gain taper at the end of the compensation": {"adaptive.settling": 1e-3},
    "separation of tremor and intended motion": {"adaptive.tremor_time": 0.0},
    "adaptive offsets": {"adaptive.level_deviation": 1e-3, "adaptive.local_deviation": 0.0},
    "offsets as functions of position": {
        "adaptive.local_deviation": 0.0,
        "adaptive.local_drift": 0.0,
    },
    "drift of the offsets": {"adaptive.level_drift": 0.0, "adaptive.local_drift": 0.0},
    "symmetry of the offsets": {"adaptive.symmetry": 0.0},
    "contact requires a slope near 1": {"adaptive.slope_tolerance": 0.99},
    "contact requires motion of the tip": {"adaptive.contact_moved": 0.0},
    "play state corrected by images": {"adaptive.state_correction": 0.0},
    "iterated estimation without outliers": {
        "state_estimation.steps": 1,
        "state_estimation.outlier_distance": 1e6,
    },
    "gain assumed to be known (0.3 instead)": {"adaptive.gain_deviation": 0.3},
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
