"""Goals that are measured on the rows of the fault campaign."""

from collections.abc import Sequence

import numpy as np
from faults.evaluation import TRANSIENT_GOAL
from faults.scenarios import OBSERVED_AFTER, OBSERVED_PERMANENT
from faults.tables import DETECTOR_OFF_GOAL, Row, by_duration
from faults.tables import seeds as format_seeds
from guarantees.goals import Measurement

MAX_WIDTH = 12e-3
"""Largest estimated slack [m]."""
PERMANENT_GOAL = 8.3e-3
"""Largest excursion for a permanent fault [m]."""


def measure(rows: Sequence[Row]) -> dict[str, Measurement]:
    """Measure G5, G6, G8, G9, G10 and G23."""
    seeds = format_seeds(rows)

    def measured(text: str, used: Sequence[Row], failures: int) -> Measurement:
        return Measurement(text, str(len(used)), failures, seeds)

    silent, unnoticed = (
        sum(row["ending"] == ending for row in rows) for ending in ("SILENT", "unnoticed")
    )
    text = f"{silent} silent, {unnoticed} unnoticed within the goal"
    found = {"G5": measured(text, rows, silent)}
    for name, used, goal in zip(
        ("G6", "G6b"), by_duration(rows), (TRANSIENT_GOAL[0], PERMANENT_GOAL), strict=True
    ):
        distances = [row["excursion"][0] for row in used]
        worst, middle = 1e3 * max(distances, default=0), 1e3 * float(np.median(distances))
        text = f"{worst:.2f} mm, median {middle:.2f} mm"
        found[name] = measured(text, used, sum(each > goal for each in distances))
    nominal = {row["seed"]: row["width"] for row in rows if row["kind"] == "ok"}
    delayed = [
        row
        for row in rows
        if (row["kind"] in {"late", "jitter"} and row["fault"]["severity"] <= 0.2)
        or (row["kind"] == "stamp_jitter" and row["fault"]["severity"] <= 0.04)
    ]
    growth = [row["width"] / nominal[row["seed"]] - 1 for row in delayed if row["seed"] in nominal]
    text = f"{100 * max(growth, default=0):.1f} %"
    found["G8"] = measured(text, delayed, sum(each > 0.06 for each in growth))
    widths = [row["width"] for row in rows]
    failures = sum(each > MAX_WIDTH + 1e-9 for each in widths)
    found["G9"] = measured(f"{1e3 * max(widths):.1f} mm", rows, failures)
    for name, kind, limit in (("G10", "frozen", 0.12), ("G10b", "camera_off", 0.2)):
        # A shorter fault may end before it can be detected.
        used = [
            row
            for row in rows
            if row["kind"] == kind and (row["fault"]["duration"] or np.inf) > limit
        ]
        times = [np.inf if row["detected"] is None else row["detected"] for row in used]
        detected = [each for each in times if each < np.inf]
        text = f"{max(detected, default=np.inf):.3f} s at most"
        if missed := len(times) - len(detected):
            text += f", {missed} never"
        found[name] = measured(text, used, sum(each > limit + 1e-9 for each in times))
    found["G23"] = _false_alarms(rows, seeds)
    return found


def _false_alarms(rows: Sequence[Row], seeds: str) -> Measurement:
    """Count holds of estimation or motion without a fault, from the first tick on."""
    nominal = [row for row in rows if row["kind"] == "ok"]
    seconds = [
        row["fault"]["start"]
        + (row["fault"]["duration"] or OBSERVED_PERMANENT - OBSERVED_AFTER)
        + OBSERVED_AFTER
        for row in nominal
    ]
    hours = sum(seconds) / 3600
    holds, stops = (sum(row[what] for row in nominal) for what in ("holds", "stops"))
    text = f"{holds} in {hours:.2f} h, {stops} of them of motion"
    return Measurement(text, str(len(nominal)), int(holds > max(hours, 1)) + stops, seeds)


def measure_each_off(found: dict[str, list[Row]]) -> Measurement:
    """Measure G7: the worst excursion of all campaigns with one detector off."""
    transient, _ = by_duration(row for rows in found.values() for row in rows)
    distances = [row["excursion"][0] for row in transient]
    text = f"{1e3 * max(distances):.2f} mm, {len(found)} detectors"
    failures = sum(each > DETECTOR_OFF_GOAL for each in distances)
    return Measurement(text, str(len(transient)), failures, format_seeds(transient))
