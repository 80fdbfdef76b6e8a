"""Ablation: profile `best` without one of its ideas at a time."""

from collections.abc import Sequence
from typing import Any

from hysteresis.tables import Row, show

IDEAS: dict[str, dict[str, Any]] = {
    "bound of the predicted tip's speed": {"law.tip_gain": 50.0},
    "free gain beyond the article's": {"law.free_gain": 5.0},
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

SHOWN = {
    "operator: reduction of tracking error": "operator: reduction [%]",
    "operator: largest error": "largest error [mm, rad]",
    "operator: tip overspeed": "tip overspeed",
    "disturbed operator: reduction of tracking error": "with tremor, flicks, pauses: reduction [%]",
    "reduction of max width": "sines: reduction of the largest width [%]",
    "start": "start [periods]",
    "three DOFs at once: reduction": "three DOFs at once: reduction [%]",
    "width 10-2-10 mm: overshoot": "width 10-2-10 mm: overshoot [mm]",
    "tremor at rest: tip": "tremor at rest: tip [mm]",
}
"""Quantities of the table, and their titles."""


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


def table(losses: Sequence[Row]) -> str:
    """Return a Markdown table: a line per idea with its values, the whole profile first."""
    lines = [f"| without | {' | '.join(SHOWN.values())} |", "|---" * (len(SHOWN) + 1) + "|"]
    found: dict[str, dict[str, list[str]]] = {}
    for row in losses:
        for name, key in (("nothing", "best"), (row["idea"], "without")):
            mine = found.setdefault(name, {}).setdefault(row["what"], [])
            if name != "nothing" or row["idea"] == losses[0]["idea"]:
                mine.append(show(row[key], row["unit"]).removesuffix(" %"))
    for name, mine in found.items():
        cells = (" / ".join(mine.get(what, [])) for what in SHOWN)
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)
