"""How each goal of benchmarks/guarantees.py is measured."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from fault_draws import WATCHED, WATCHED_FOR_GOOD, configured
from fault_hand import Hand
from fault_judgement import PASSING
from fault_tables import seeds as seeds_of
from fault_watch import FeatureTwin, look
from tautscope import HysteresisReduction, load_config
from tautscope.dof import Dof
from tautscope.runs.experiment import run_experiment

Row = dict[str, Any]

WIDEST = 12e-3
"""Slack that is believed in at most [m]."""
LASTING = 8.3e-3
"""Goal of the tip when compensation is lost for good [m]."""
DORMANT = 3e-3
"""Goal of the tip with a detector off [m]."""


@dataclass(frozen=True)
class Figure:
    """What was measured.

    Attributes:
        text: The figure.
        runs: How many runs, steps or cases.
        failures: How many of them missed the goal.
        seeds: Of the runs.
    """

    text: str
    runs: str
    failures: int
    seeds: str = ""

    def beside(self, other: Figure) -> Figure:
        """Both in one row."""
        text, runs = f"{self.text}; {other.text}", f"{self.runs}; {other.runs}"
        return replace(self, text=text, runs=runs, failures=self.failures + other.failures)


def campaign(rows: Sequence[Row]) -> dict[str, Figure]:
    """G5, G6, G8, G9, G10 and G23 from the rows of the fault campaign."""
    seeds = seeds_of(rows)

    def figure(text: str, used: Sequence[Row], failures: int) -> Figure:
        return Figure(text, str(len(used)), failures, seeds)

    silent = [row for row in rows if row["ending"] == "SILENT"]
    quiet = sum(row["ending"] == "unnoticed" for row in rows)
    text = f"{len(silent)} silent, {quiet} unnoticed within the goal"
    found = {"G5": figure(text, rows, len(silent))}
    for name, passing, goal in (("G6", True, PASSING[0]), ("G6b", False, LASTING)):
        own = [row for row in rows if row["passing"] is passing]
        far = [row["excursion"][0] for row in own]
        text = f"{1e3 * max(far, default=0):.2f} mm, median {1e3 * float(np.median(far)):.2f} mm"
        found[name] = figure(text, own, sum(each > goal for each in far))
    nominal = {row["seed"]: row["width"] for row in rows if row["kind"] == "ok"}
    timed = [
        row
        for row in rows
        if (row["kind"] in {"late", "jitter"} and row["fault"]["severity"] <= 0.2)
        or (row["kind"] == "stamp_jitter" and row["fault"]["severity"] <= 0.04)
    ]
    wider = [row["width"] / nominal[row["seed"]] - 1 for row in timed if row["seed"] in nominal]
    text = f"{100 * max(wider, default=0):.1f} %"
    found["G8"] = figure(text, timed, sum(each > 0.06 for each in wider))
    widths = [row["width"] for row in rows]
    found["G9"] = figure(
        f"{1e3 * max(widths):.1f} mm", rows, sum(each > WIDEST + 1e-9 for each in widths)
    )
    for name, kind, limit in (("G10", "frozen", 0.12), ("G10b", "camera_off", 0.2)):
        # A shorter fault may be over before it can be noticed.
        own = [
            row
            for row in rows
            if row["kind"] == kind and (row["fault"]["duration"] or np.inf) > limit
        ]
        times = [np.inf if row["detected"] is None else row["detected"] for row in own]
        noticed = [each for each in times if each < np.inf]
        text = f"{max(noticed, default=np.inf):.3f} s at most"
        if never := len(times) - len(noticed):
            text += f", {never} never"
        found[name] = figure(text, own, sum(each > limit + 1e-9 for each in times))
    found["G23"] = _spurious(rows, seeds)
    return found


def _spurious(rows: Sequence[Row], seeds: str) -> Figure:
    """Learning or motion held while nothing failed, from the first tick of the loop on."""
    ok = [row for row in rows if row["kind"] == "ok"]
    seconds = [
        row["fault"]["start"] + (row["fault"]["duration"] or WATCHED_FOR_GOOD - WATCHED) + WATCHED
        for row in ok
    ]
    hours = sum(seconds) / 3600
    holds, stops = (sum(row[what] for row in ok) for what in ("holds", "stops"))
    text = f"{holds} in {hours:.2f} h, {stops} of them of motion"
    return Figure(text, str(len(ok)), int(holds > max(hours, 1)) + stops, seeds)


def each_off(found: dict[str, list[Row]]) -> Figure:
    """G7: the worst of all campaigns with a detector off."""
    passing = [row for part in found.values() for row in part if row["passing"]]
    far = [row["excursion"][0] for row in passing]
    worst = f"{1e3 * max(far):.2f} mm, {len(found)} detectors"
    return Figure(worst, str(len(passing)), sum(each > DORMANT for each in far), seeds_of(passing))


def stalls(count: int) -> Figure:
    """G14: the loop is not called for a while, and the hand goes on."""
    config = load_config(profile="best")
    period, chance = config.control.period, np.random.default_rng(14)
    speed = config.safety.command_speed[0]
    worst, broken = 0.0, 0
    loop, time, last = HysteresisReduction(config), 0.0, 0.0
    for stall in range(count):
        if stall % 50 == 0:
            loop, time = HysteresisReduction(config), float(chance.uniform(0, 8))
        for tick in range(20):
            time += period if tick else float(chance.uniform(0.005, 2.0))
            swing = 15e-3 * np.sin(2 * np.pi * time / 7.5)
            command = float(loop.step([0.025 + swing, 0.0, 0.9], time)[0])
            step = abs(command - last) if stall % 50 or tick else 0.0
            worst, broken = max(worst, step), broken + (step > speed * period * (1 + 1e-9))
            last = command
        loop.engage()
    text = f"{1e3 * worst:.3f} mm, v_max dt = {1e3 * speed * period:.3f} mm"
    return Figure(text, str(count), broken, "14")


def replays(count: int) -> Figure:
    """G19: the same run, again and again."""
    prints = [_digest() for _ in range(count)]
    return Figure(f"{len(set(prints))} kind(s) of bytes", str(count), len(set(prints)) - 1, "19")


def _digest() -> str:
    config = configured(19, "best", ())
    twin = FeatureTwin(config)
    hand = Hand(config, dict.fromkeys(Dof, 3.0), lambda: twin.time, 2.0)
    recording = run_experiment(twin, hand, config, look=look)
    return hashlib.sha256(recording.trace.tobytes() + recording.frames.tobytes()).hexdigest()
