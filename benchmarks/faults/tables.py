"""Rows and Markdown tables of the fault campaign."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from faults.evaluation import TRANSIENT_GOAL, Outcome, classify, permanent_goal
from faults.scenarios import SLACK
from tautscope.twin.faults import KINDS

Row = dict[str, Any]

ENDINGS = ("masked", "warned", "stopped", "unnoticed", "SILENT")
DETECTOR_OFF_GOAL = 0.3 * SLACK[0]
"""Largest excursion for a transient fault with one detector off [m]."""


def to_row(outcome: Outcome, profile: str = "best") -> Row:
    """Return an outcome as numbers and words; None for NaN and infinity."""
    row = asdict(outcome) | {"passing": outcome.is_transient, "profile": profile}
    row["fault"]["dof"] = outcome.fault.dof.label
    row["fault"]["duration"] = _finite(outcome.fault.duration)
    row["detected"] = _finite(outcome.detected)
    return with_verdict(row)


def with_verdict(row: Row) -> Row:
    """Return a row with its verdict by the present goals."""
    is_detected = row["detected"] is not None
    goal = TRANSIENT_GOAL if row["passing"] else permanent_goal(row["profile"])
    return row | classify(row["excursion"], row["tip"], goal, is_detected, row["stopped"])


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def summary(rows: Sequence[Row]) -> str:
    """Summarise the campaign in a few sentences."""
    ended = Counter(row["ending"] for row in rows)
    transient, permanent = by_duration(rows)
    counts = ", ".join(f"{ended[name]} {name}" for name in ENDINGS)
    return (
        f"N = {len(rows)} runs of {len({row['kind'] for row in rows})} kinds, seeds {seeds(rows)}: "
        f"{counts}. k = {sum(row['beyond'] for row in rows)} beyond the goal. Insertion, worst "
        f"excursion: {_worst(transient):.2f} mm for transient faults, {_worst(permanent):.2f} mm "
        "for permanent ones."
    )


def by_duration(rows: Iterable[Row]) -> tuple[list[Row], list[Row]]:
    """Return the rows of transient faults and those of permanent ones."""
    parts: tuple[list[Row], list[Row]] = [], []
    for row in rows:
        parts[0 if row["passing"] else 1].append(row)
    return parts


def seeds(rows: Sequence[Row]) -> str:
    """Return the seeds as a range, or one by one if some are missing."""
    used = sorted({row["seed"] for row in rows})
    if len(used) > 1 and used == list(range(used[0], used[-1] + 1)):
        return f"{used[0]} to {used[-1]}"
    return ", ".join(str(seed) for seed in used)


def table(rows: Sequence[Row]) -> str:
    """Return a line per kind with runs beyond the goal, and then the other kinds in short."""
    lines = [
        "| fault, hazard | severity | beyond (SILENT) | transient: worst [mm] "
        "| permanent: worst | detected, median of the time [s] | mostly |",
        "|---|---|--:|---|---|---|---|",
    ]
    within = []
    for name, kind in KINDS.items():
        own = [row for row in rows if row["kind"] == name]
        title = f"{name} {kind.hazard}".strip()
        if any(row["beyond"] or row["ending"] == "SILENT" for row in own):
            low, high = kind.severity
            severity = f"{low:g} to {high:g} {kind.unit}" if kind.unit else ""
            cells = (title, severity, *_cells(own))
            lines.append("| " + " | ".join(str(cell) for cell in cells) + " |")
        elif own:
            found = sum(row["detected"] is not None for row in own)
            within.append(f"{title} ({_worst(own):.2f}, {found})")
    if within:
        text = "No run is beyond the goal (worst excursion in mm, detected)"
        lines += ["", f"{text}: {', '.join(within)}."]
    return "\n".join(lines)


def _cells(own: Sequence[Row]) -> list[Any]:
    times = [row["detected"] for row in own if row["detected"] is not None]
    reached = Counter(row["reaction"] for row in own if row["reaction"] != "none")
    silent = sum(row["ending"] == "SILENT" for row in own)
    return [
        f"{sum(row['beyond'] for row in own) or ''}{f' ({silent})' if silent else ''}",
        *(_excursion(part) for part in by_duration(own)),
        f"{len(times)}, {np.median(times):.2f}" if times else "0",
        next((name for name, _ in reached.most_common(1)), ""),
    ]


def _excursion(rows: Sequence[Row]) -> str:
    return f"{_worst(rows):.2f}" if rows else ""


def beyond(rows: Sequence[Row]) -> str:
    """Return how many runs of each kind are beyond the goal."""
    found = Counter(row["kind"] for row in rows if row["beyond"])
    return f"Beyond: {', '.join(f'{name} {count}' for name, count in found.most_common())}."


def off_table(found: dict[str, Sequence[Row]]) -> str:
    """Return the table of detectors that were switched off, and which no run needs."""
    lines = [
        "| detectors off: runs repeated | worst, transient [mm] | worst, permanent [mm] "
        "| transient, beyond 3 mm | SILENT |",
        "|---|--:|--:|--:|--:|",
    ]
    unused = []
    alike: dict[tuple[Any, ...], list[str]] = {}
    for name, rows in found.items():
        repeated = sum(name in row["raised"] for row in rows)
        if not repeated:
            unused.append(f"`{name}`")
            continue
        transient, permanent = by_duration(rows)
        cells = (
            f"{_worst(transient):.2f}",
            f"{_worst(permanent):.2f}",
            sum(row["excursion"][0] > DETECTOR_OFF_GOAL for row in transient) or "",
            sum(row["ending"] == "SILENT" for row in rows) or "",
        )
        alike.setdefault(cells, []).append(f"{name} {repeated}")
    lines += [
        "| " + " | ".join(map(str, (", ".join(names), *cells))) + " |"
        for cells, names in alike.items()
    ]
    number = len(next(iter(found.values())))
    none = f" No run raises {', '.join(unused)}." if unused else ""
    return f"{number} runs each.{none}\n\n" + "\n".join(lines)


def _worst(rows: Iterable[Row]) -> float:
    return 1e3 * max((row["excursion"][0] for row in rows), default=0.0)


def goals(profile: str) -> str:
    """Describe the goals."""
    transient, permanent = (
        f"{1e3 * goal[0]:.3g} mm, {goal[1]:.3g} rad, {goal[2]:.3g} rad"
        for goal in (TRANSIENT_GOAL, permanent_goal(profile))
    )
    return (
        f"Goal: at most {transient} for a transient fault, {permanent} for a permanent one: the "
        "slack that the profile compensates, and a margin."
    )
