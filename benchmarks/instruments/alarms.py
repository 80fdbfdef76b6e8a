"""Alarms without a fault: the share of the images with each flag."""

from collections.abc import Iterable

import numpy as np
from instruments.rows import Row

GOAL = 0.01
"""Largest share of the images of a run with a flag."""


def alarm_table(rows: Iterable[Row]) -> str:
    """Return a Markdown table of the flags of `best` under an operator's motion; empty without."""
    hand = [row["runs"] for row in rows if row["motion"] == "hand"]
    runs = [variants["best"] for variants in hand if "best" in variants]
    if not runs:
        return ""
    shares = {
        flag: np.array([run["flags"].get(flag, 0) / max(run["images"], 1) for run in runs])
        for flag in sorted({flag for run in runs for flag in run["flags"]})
    }
    lines = [
        f"| flag | images, median | 90th percentile | instruments of {len(runs)} within 1 % |",
        "|---|--:|--:|--:|",
    ]
    for flag, found in sorted(shares.items(), key=lambda item: -np.median(item[1])):
        median, high = 100 * np.median(found), 100 * np.percentile(found, 90)
        lines.append(f"| {flag} | {median:.1f} % | {high:.1f} % | {(found <= GOAL).sum()} |")
    return "\n".join(lines)
