"""Goals of reliability, and their table in docs/safety.md."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from common.doc_pages import insert
from common.paths import ROOT

PAGE = ROOT / "docs" / "safety.md"


@dataclass(frozen=True)
class Measurement:
    """Result of one measurement of a goal.

    Attributes:
        text: Result in words.
        runs: Number of runs, steps or cases.
        failures: How many of them missed the goal.
        seeds: Seeds of the runs.
    """

    text: str
    runs: str
    failures: int
    seeds: str = ""

    @classmethod
    def of_times(cls, times: Iterable[float], limit: float, seeds: str) -> Measurement:
        """Return the measurement of times [s] with an upper limit."""
        times = list(times)
        late = sum(each > limit + 1e-9 for each in times)
        return cls(f"{max(times):.3f} s at most", str(len(times)), late, seeds)

    def join(self, other: Measurement) -> Measurement:
        """Return both results in one row."""
        text, runs = f"{self.text}; {other.text}", f"{self.runs}; {other.runs}"
        return replace(self, text=text, runs=runs, failures=self.failures + other.failures)


@dataclass(frozen=True)
class Goal:
    """Name, quantity and target of a goal."""

    name: str
    what: str
    target: str


GOALS = (
    Goal("G1", "command travel over reference travel, random steps and events", "at most K_b"),
    Goal("G2", "command while the reference rests", "at rest, to the bit"),
    Goal("G3", "drift over ticks and reversals", "at most 1e-9 mm"),
    Goal("G4", "overshoot with over-estimated slack", "as derived, within 0.01 mm"),
    Goal("G5", "faults detected, or without effect", "0 silent unsafe in 20 000"),
    Goal("G6", "excursion, transient fault", "at most 1.0 mm"),
    Goal("G6b", "excursion, permanent fault", "at most 8.3 mm"),
    Goal("G7", "excursion, any one detector off", "at most 3.0 mm"),
    Goal("G8", "estimated slack, latency to 200 ms or times off by a frame", "at most 6 % more"),
    Goal("G9", "estimated slack, any fault", "at most 12 mm"),
    Goal("G10", "detection time, frozen image", "3 frames, 0.12 s"),
    Goal("G10b", "detection time, camera off", "0.2 s"),
    Goal("G10c", "input device silent: time until the command rests", "0.05 s and a tick"),
    Goal("G10d", "heartbeat of a drive lost: time until all stop", "0.1 s and a cycle"),
    Goal("G11", "web messages: mutated texts into the decoders", "no crash, all in range"),
    Goal("G12", "allocations in a tick, through every flag and reaction", "none"),
    Goal("G13", "time of a tick under load", "p99.99 100 us, at most 1 ms"),
    Goal("G14", "step of the command after a stall of 5 ms to 2 s", "at most v_max dt"),
    Goal("G15", "soak test, 1000 h", "no growth of memory, files, or the tip's error"),
    Goal("G16", "recordings of killed processes", "all readable, 100 ms lost at most"),
    Goal("G17", "disk full, slow, failing", "no late tick"),
    Goal("G18", "logs cut at every byte, or with a flipped bit", "no crash, whole chunks read"),
    Goal("G19", "repeated run", "identical to the bit"),
    Goal("G20", "console: no token, forged origin or host, malformed, no lease", "no motion"),
    Goal("G20b", "console: STOP under load until it is in force", "p99 0.05 s"),
    Goal("G20c", "console: link lost while steering: until the reference rests", "0.25 s, a tick"),
    Goal("G20d", "console: commands of a second page", "all refused"),
    Goal("G20e", "console: repeated, old and reordered commands", "no motion"),
    Goal("G20f", "console: network stands for 2 s, then delivers all", "no motion"),
    Goal("G21", "second master on the bus", "all refused"),
    Goal("G22", "unsafe, unwrap, panic, indexing in the core", "denied by the compiler"),
    Goal("G22b", "mutation testing of algorithms, models and monitors", "no mutant survives"),
    Goal("G23", "false alarms: holds in nominal use", "at most 1 per hour"),
    Goal("G24", "all monitors on: reduction; 10 to 6 mm in 5 s tracked", "75 %; 2 strokes"),
)


def write(found: Mapping[str, Measurement]) -> None:
    """Update the table of docs/safety.md."""
    insert(PAGE, "guarantees", table(found))


def table(found: Mapping[str, Measurement]) -> str:
    """Return the table of all goals; those that were not measured keep their results."""
    head = "| | goal | target | result | N (seeds) | k | measured |\n|---|---|---|---|---|---|---|"
    page = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    old = {line.split("|")[1].strip(): line for line in page.splitlines() if line[:3] == "| G"}
    return "\n".join([head, *(_row(goal, found.get(goal.name), old) for goal in GOALS)])


def _row(goal: Goal, measured: Measurement | None, old: Mapping[str, str]) -> str:
    start = f"| {goal.name} | {goal.what} | {goal.target} |"
    if measured is None:
        before = old.get(goal.name, "")
        cells = before.split("|")[4:-1] if before else [" not measured ", *[" "] * 3]
        return start + "|".join(cells) + "|"
    today = datetime.now(UTC).date().isoformat()
    k = f"{measured.failures}, missed" if measured.failures else "0"
    runs = measured.runs + (f" ({measured.seeds})" if measured.seeds else "")
    return f"{start} {measured.text} | {runs} | {k} | {today} |"
