"""The goals of reliability, each with its figure, in one table of docs/safety.md.

Only what is asked for is measured; `--write` leaves the rows of the others as they are.

    uv run python benchmarks/guarantees.py --minutes 60 --write
    uv run python benchmarks/guarantees.py --steps 1000000000 --hours 1000 --write
    uv run python benchmarks/guarantees.py --campaign rows.json --each each.json --write
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import guarantee_logs as logs
import guarantee_loop as loop
import guarantee_rows as rows
import guarantee_silence as silence
from doc_pages import ROOT, insert
from faults import read
from guarantee_mutants import mutants

PAGE = ROOT / "docs" / "safety.md"
HEAD = (
    "| | goal | target | figure | N | k | seeds | measured |\n|---|---|---|---|---|---|---|---|\n"
)


@dataclass(frozen=True)
class Goal:
    """A row of the table."""

    name: str
    what: str
    target: str


GOALS = (
    Goal("G1", "command's travel over the reference's, random steps and events", "at most K_b"),
    Goal("G2", "command at rest while the reference is", "to the bit"),
    Goal("G3", "drift over ticks and reversals", "at most 1e-9 mm"),
    Goal("G4", "overshoot of an over-estimated slack", "the law, within 0.01 mm"),
    Goal("G5", "faults noticed, or without effect", "0 silent unsafe in 20 000"),
    Goal("G6", "tip, fault that passes", "at most 1.0 mm"),
    Goal("G6b", "tip, fault that stays", "at most 8.3 mm"),
    Goal("G7", "tip, any one detector off", "at most 3.0 mm"),
    Goal("G8", "latency to 200 ms, or times off by a frame: slack believed in", "at most 6 % more"),
    Goal("G9", "slack believed in, whatever fails", "at most 12 mm"),
    Goal("G10", "frozen picture noticed", "within 3 frames, 0.12 s"),
    Goal("G10b", "camera off noticed", "within 0.2 s"),
    Goal("G10c", "hand's device silent: command at rest", "within 0.05 s and a tick"),
    Goal("G10d", "heartbeat of a drive lost: all in quick stop", "within 0.1 s and a cycle"),
    Goal("G12", "allocation in the tick, through every flag and reaction", "none"),
    Goal("G13", "time of a tick under load", "p99.99 100 us, at most 1 ms"),
    Goal("G14", "command's step after a stall of 5 ms to 2 s", "at most v_max dt"),
    Goal("G15", "soak, 1000 h", "no growth of memory, files, or the tip's error"),
    Goal("G16", "recordings killed", "all readable, 100 ms lost at most"),
    Goal("G17", "disk full, slow, failing", "no tick missed"),
    Goal("G18", "logs cut at every byte, and a bit flipped", "no crash, whole chunks read"),
    Goal("G19", "the same run again", "to the bit"),
    Goal("G22", "unsafe, unwrap, panic, indexing in the core", "denied by the compiler"),
    Goal("G22b", "lines broken on purpose in what guards", "none survives the tests"),
    Goal("G23", "spurious holds of nominal use", "at most 1 per hour"),
    Goal("G24", "under guards: reduction; 10 to 6 mm in 5 s followed", "75 %; 2 strokes"),
)


@dataclass(frozen=True)
class Size:
    """Of a measurement.

    Attributes:
        goal: What the goal asks for; of `cuts` it is the step between two.
        seconds: It takes on a machine of its own, waiting included.
    """

    goal: float
    seconds: float


SIZES = {
    "steps": Size(1_000_000_000, 350),
    "ticks": Size(1_000_000, 40),
    "hours": Size(1_000, 3_000),
    "loaded": Size(100_000, 100),
    "stalls": Size(10_000, 5),
    "silences": Size(1_000, 10),
    "heartbeats": Size(100, 300),
    "replays": Size(256, 25),
    "kills": Size(1_000, 3_000),
    "cuts": Size(1, 200),
    "disks": Size(1, 20),
    "function": Size(1, 20),
    "code": Size(1, 20),
    "mutants": Size(40, 2_400),
}


def sizes(minutes: float) -> dict[str, float]:
    """Of all measurements that fit: the cheap ones whole, the rest as much time each."""
    left, found = 60 * minutes, {}
    costs = sorted(SIZES.items(), key=lambda item: item[1].seconds)
    for done, (name, size) in enumerate(costs):
        share = min(1.0, left / (len(costs) - done) / size.seconds)
        left -= share * size.seconds
        wanted = size.goal / share if name == "cuts" else size.goal * share
        found[name] = max(1.0, float(f"{wanted:.2g}"))
    return found


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])

    def count(name: str, text: str, kind: type = int) -> None:
        parser.add_argument(f"--{name}", type=kind, default=0, metavar="N", help=text)

    count("steps", "G1 to G4, in Rust: 1000000000")
    count("ticks", "G12, in Rust: 1000000")
    count("hours", "G15, in Rust: 1000", float)
    count("loaded", "G13: ticks under load, 100000")
    count("stalls", "G14: 10000")
    count("silences", "G10c: of the hand, 1000")
    count("heartbeats", "G10d: lost, on the simulated bus, 100")
    count("replays", "G19: 256")
    count("kills", "G16: 1000")
    count("cuts", "G18: every N-th byte, 1")
    count("mutants", "G22b: cargo mutants, minutes at most; goes on where it was", float)
    parser.add_argument("--disks", action="store_true", help="G17")
    parser.add_argument("--function", action="store_true", help="G24")
    parser.add_argument("--code", action="store_true", help="G22: what the compiler checks")
    count("minutes", "all of these in about so many; 180 is every goal whole", float)
    parser.add_argument("--campaign", type=Path, nargs="+", help="G5 to G10, G23: of faults.py")
    parser.add_argument("--each", type=Path, nargs="+", help="G7: of faults.py --off each")
    parser.add_argument("--write", action="store_true", help=f"into {PAGE.relative_to(ROOT)}")
    options = parser.parse_args()
    if options.minutes:
        for name, value in sizes(options.minutes).items():
            kind = type(getattr(options, name))
            setattr(options, name, getattr(options, name) or kind(value))
    return options


def measures() -> dict[str, Callable[[Any], dict[str, rows.Figure]]]:
    """What an option has measured, given its value."""
    return {
        "loaded": lambda count: {"G13": loop.ticks_under_load(count)},
        "steps": lambda count: core("--lib", "properties::guarantees", TAUTSCOPE_STEPS=count),
        "ticks": lambda count: core("--test no_alloc", "allocate", TAUTSCOPE_TICKS=count),
        "hours": lambda hours: core("--test soak", "", TAUTSCOPE_HOURS=hours),
        "stalls": lambda count: {"G14": rows.stalls(count)},
        "silences": lambda count: {"G10c": silence.hand_silent(count)},
        "heartbeats": lambda count: {"G10d": silence.heartbeat_lost(count)},
        "replays": lambda count: {"G19": rows.replays(count)},
        "kills": lambda count: {"G16": kills(count)},
        "cuts": lambda every: {"G18": logs.cuts(every)},
        "disks": lambda _: {"G17": logs.disks()},
        "function": lambda _: {"G24": loop.function()},
        "code": lambda _: {"G22": code()},
        "mutants": lambda minutes: {"G22b": mutants(minutes)},
        "campaign": lambda files: rows.campaign(whole(files)),
        "each": lambda files: {"G7": rows.each_off(read(files))},
    }


def main() -> None:
    """Each goal is written as soon as it is measured: what was stopped has what came before."""
    options = arguments()
    found: dict[str, rows.Figure] = {}
    for name, measure in measures().items():
        if wanted := getattr(options, name):
            print(f"{name} {wanted} ...", file=sys.stderr, flush=True)
            begin, used = time.monotonic(), _computed()
            found |= measure(wanted)
            took = f"{time.monotonic() - begin:.0f} s, {_computed() - used:.0f} s of a core"
            print(f"{name} {wanted}: {took}", file=sys.stderr, flush=True)
            if options.write:
                insert(PAGE, "guarantees", table(found))
    print(table(found))


def _computed() -> float:
    """By this process and its children so far [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def whole(files: Iterable[Path]) -> list[rows.Row]:
    """The rows of the campaign with all guards."""
    return [row for part in read(files).values() for row in part]


def core(test: str, only: str, **wanted: float) -> dict[str, rows.Figure]:
    """What a test of the core prints; it counts allocations only with its assertions on."""
    command = ["cargo", "test", "--profile", "proof", "-p", "tautscope-core", *test.split(), only]
    done = subprocess.run(
        [*command, "--", "--nocapture", "--test-threads", "1"],
        cwd=ROOT,
        env=os.environ | {name: str(value) for name, value in wanted.items()},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    found = printed(done.stdout)
    if not found:
        raise RuntimeError(done.stdout)
    return found


UNITS = {
    "G1": "{:.2g} last places over",
    "G2": "exact",
    "G3": "{:.2g} mm",
    "G4": "{:.2g} mm",
    "G12": "none",
    "G15": "{:.2f} times the tip's error",
}


def printed(text: str) -> dict[str, rows.Figure]:
    """What those tests say: goal, law, number, how many missed it, worst."""
    said = re.findall(
        r"\b(G\d+) (paper|best|both|recovering) (\d+) (\d+) (\S+)$", text, re.MULTILINE
    )
    found: dict[str, rows.Figure] = {}
    for name, law, number, broken, worst in said:
        figure = rows.Figure(f"{law}: {UNITS[name].format(float(worst))}", number, int(broken))
        found[name] = found[name].beside(figure) if name in found else figure
    return found


def kills(count: int) -> rows.Figure:
    """G16: recordings of a process that is killed."""
    command = [sys.executable, "benchmarks/recordings.py", "--kills", str(count)]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    facts = json.loads(done.stdout)
    bad = count - facts["readable"] + facts["with_holes"]
    text = f"{facts['readable']} readable, {facts['lost_max_s']} s lost at most"
    return rows.Figure(text, str(count), bad, "0")


def code() -> rows.Figure:
    """What the compiler denies, and that it has nothing to deny."""
    manifest = (ROOT / "Cargo.toml").read_text(encoding="utf-8")
    library = (ROOT / "crates/core/src/lib.rs").read_text(encoding="utf-8")
    wanted = ("unwrap_used", "expect_used", "panic", "indexing_slicing")
    missing = [name for name in wanted if f"clippy::{name}" not in library]
    missing += [] if re.search(r'unsafe_code = "forbid"', manifest) else ["unsafe_code"]
    command = ["cargo", "clippy", "-p", "tautscope-core", "--quiet", "--", "-D", "warnings"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    missing += ["clippy"] if done.returncode else []
    return rows.Figure("not denied: " + (", ".join(missing) or "none"), "1", len(missing))


def table(found: dict[str, rows.Figure]) -> str:
    """All goals; what was not measured keeps its row, or says so."""
    old = kept(PAGE.read_text(encoding="utf-8") if PAGE.exists() else "")
    return HEAD + "\n".join(line(goal, found, old) for goal in GOALS)


def kept(page: str) -> dict[str, str]:
    """The rows that are there."""
    return {text.split("|")[1].strip(): text for text in page.splitlines() if text[:3] == "| G"}


def line(goal: Goal, found: dict[str, rows.Figure], old: dict[str, str]) -> str:
    """One row."""
    figure = found.get(goal.name)
    start = f"| {goal.name} | {goal.what} | {goal.target} |"
    if figure is None:
        before = old.get(goal.name, "")
        cells = before.split("|")[4:-1] if before else [" not measured ", *[" "] * 4]
        return start + "|".join(cells) + "|"
    today = datetime.now(UTC).date().isoformat()
    k = f"{figure.failures}, missed" if figure.failures else "0"
    return f"{start} {figure.text} | {figure.runs} | {k} | {figure.seeds} | {today} |"


if __name__ == "__main__":
    main()
