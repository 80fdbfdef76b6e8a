"""Tables of the fault campaign from its rows."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from fault_draws import PLAY
from fault_judgement import PASSING, TAKEN, Outcome, judged, lasting
from tautscope.twin.faults import KINDS

Row = dict[str, Any]

ENDINGS = ("masked", "warned", "stopped", "unnoticed", "SILENT")


def to_row(outcome: Outcome, profile: str = "best") -> Row:
    """Plain numbers and words; NaN and infinity are None."""
    found = asdict(outcome) | {"passing": outcome.passing, "profile": profile}
    found["fault"]["dof"] = outcome.fault.dof.label
    found["fault"]["duration"] = _finite(outcome.fault.duration)
    found["detected"] = _finite(outcome.detected)
    return judge(found)


def judge(row: Row) -> Row:
    """With what is to be said of it; the goals may have changed since it was kept."""
    noticed = row["detected"] is not None
    goal = PASSING if row["passing"] else lasting(row["profile"])
    return row | judged(row["excursion"], row["tip"], goal, noticed, row["stopped"])


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def summary(rows: Sequence[Row]) -> str:
    """What the whole campaign comes to, in a sentence or two."""
    ended = Counter(row["ending"] for row in rows)
    beyond = sum(row["beyond"] for row in rows)
    passing = [row["excursion"][0] for row in rows if row["passing"]]
    lasting = [row["excursion"][0] for row in rows if not row["passing"]]
    counts = ", ".join(f"{ended[name]} {name}" for name in ENDINGS)
    kinds = {row["kind"] for row in rows}
    return (
        f"N = {len(rows)} runs of {len(kinds)} kinds, seeds {seeds(rows)}: {counts}. "
        f"k = {beyond} beyond the goal. Insertion, worst excursion: "
        f"{1e3 * max(passing, default=0):.2f} mm of faults that pass, "
        f"{1e3 * max(lasting, default=0):.2f} mm of those that stay."
    )


def seeds(rows: Sequence[Row]) -> str:
    """From which to which, or each where some are missing."""
    used = sorted({row["seed"] for row in rows})
    if len(used) > 1 and used == list(range(used[0], used[-1] + 1)):
        return f"{used[0]} to {used[-1]}"
    return ", ".join(str(seed) for seed in used)


def table(rows: Sequence[Row]) -> str:
    """A line per kind and duration."""
    lines = [
        "| fault | hazard | stays | N | k | worst excursion [mm, rad, rad] | tip [mm] | noticed "
        f"after, median (worst) [s] | noticed | {' | '.join(ENDINGS)} | highest reactions |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, kind in KINDS.items():
        for passing in (True, False):
            own = [row for row in rows if row["kind"] == name and row["passing"] is passing]
            if own:
                stays = "for good" if not passing else ""
                lines.append(f"| {name} | {kind.hazard} | {stays} | {_cells(own)} |")
    return "\n".join(lines)


def _cells(own: Sequence[Row]) -> str:
    far = np.array([row["excursion"] for row in own]).max(axis=0)
    known = [row["detected"] for row in own if row["detected"] is not None]
    noticed = f"{np.median(known):.2f} ({max(known):.2f})" if known else ""
    ended = Counter(row["ending"] for row in own)
    reached = Counter(row["reaction"] for row in own if row["reaction"] != "none")
    cells = [
        len(own),
        sum(row["beyond"] for row in own),
        f"{1e3 * far[0]:.2f}, {far[1]:.3f}, {far[2]:.3f}",
        f"{1e3 * max(row['tip'][0] for row in own):.2f}" if own[0]["kind"] in TAKEN else "",
        noticed,
        len(known),
        *(ended[name] or "" for name in ENDINGS),
        ", ".join(f"{name} {count}" for name, count in reached.most_common(3)),
    ]
    return " | ".join(str(cell) for cell in cells)


def kinds_table() -> str:
    """What each kind is."""
    lines = ["| fault | of | how | severity | what |", "|---|---|---|---|---|"]
    for kind in KINDS.values():
        low, high = kind.severity
        size = f"{low:g} to {high:g} {kind.unit}" if kind.unit else ""
        lines.append(f"| {kind.name} | {kind.target} | {kind.mode} | {size} | {kind.what} |")
    return "\n".join(lines)


def off_table(found: dict[str, Sequence[Row]]) -> str:
    """A line per detector switched off."""
    lines = [
        "| detector off | N | of them run again | worst, passes [mm] | worst, stays [mm] | k "
        "beyond 3 mm, passes | SILENT | worst kinds |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, rows in found.items():
        passing = [row for row in rows if row["passing"]]
        lasting = [row for row in rows if not row["passing"]]
        worst = sorted(passing, key=lambda row: -row["excursion"][0])
        named = list(dict.fromkeys(row["kind"] for row in worst[:10]))[:3]
        cells = [
            name,
            len(rows),
            sum(name in row["raised"] for row in rows),
            f"{_worst(passing):.2f}",
            f"{_worst(lasting):.2f}",
            sum(row["excursion"][0] > DORMANT for row in passing),
            sum(row["ending"] == "SILENT" for row in rows),
            ", ".join(named),
        ]
        lines.append("| " + " | ".join(str(cell) for cell in cells) + " |")
    return "\n".join(lines)


DORMANT = 0.3 * PLAY[0]
"""Goal with one detector off [m]."""


def _worst(rows: Iterable[Row]) -> float:
    return 1e3 * max((row["excursion"][0] for row in rows), default=0.0)


def goals(profile: str) -> str:
    """The limits in words."""
    stays = lasting(profile)
    passing = f"{1e3 * PASSING[0]:.3g} mm, {PASSING[1]:.3g} rad, {PASSING[2]:.3g} rad"
    lasts = f"{1e3 * stays[0]:.3g} mm, {stays[1]:.3g} rad, {stays[2]:.3g} rad"
    return (
        f"Goal: at most {passing} for a fault that passes, {lasts} for one that stays: as much as "
        "the profile makes up for, which is given back when it no longer can."
    )
