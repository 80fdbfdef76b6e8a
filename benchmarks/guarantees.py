"""The goals of reliability, each with its figure, in one table of docs/safety.md.

Only what is asked for is measured; `--write` leaves the rows of the others as they are.

    uv run python benchmarks/guarantees.py --short --write
    uv run python benchmarks/guarantees.py --steps 1000000000 --hours 1000 --mutants --write
    uv run python benchmarks/guarantees.py --campaign rows.json --each each.json --write
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import guarantee_logs as logs
import guarantee_loop as loop
import guarantee_rows as rows
from doc_pages import ROOT, insert
from faults import read

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


SHORT = {
    "steps": 50_000_000,
    "ticks": 1_000_000,
    "hours": 20.0,
    "loaded": 50_000,
    "stalls": 2_000,
    "replays": 32,
    "kills": 50,
    "cuts": 2_000,
    "disks": True,
    "function": True,
    "code": True,
}
"""Minutes, for what takes hours; the goals' own numbers are in the help."""


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])

    def count(name: str, text: str, kind: type = int) -> None:
        parser.add_argument(f"--{name}", type=kind, default=0, metavar="N", help=text)

    count("steps", "G1 to G4, in Rust: 1000000000")
    count("ticks", "G12, in Rust: 1000000")
    count("hours", "G15, in Rust: 1000", float)
    count("loaded", "G13: ticks under load, 100000")
    count("stalls", "G14: 10000")
    count("replays", "G19: 256")
    count("kills", "G16: 1000")
    count("cuts", "G18: every N-th byte, 1")
    parser.add_argument("--disks", action="store_true", help="G17")
    parser.add_argument("--function", action="store_true", help="G24")
    parser.add_argument("--code", action="store_true", help="G22: what the compiler checks")
    parser.add_argument("--mutants", action="store_true", help="G22b: cargo mutants, hours")
    parser.add_argument("--short", action="store_true", help="all of these but it, in minutes")
    parser.add_argument("--campaign", type=Path, nargs="+", help="G5 to G10, G23: of faults.py")
    parser.add_argument("--each", type=Path, nargs="+", help="G7: of faults.py --off each")
    parser.add_argument("--write", action="store_true", help=f"into {PAGE.relative_to(ROOT)}")
    options = parser.parse_args()
    if options.short:
        for name, value in SHORT.items():
            setattr(options, name, getattr(options, name) or value)
    return options


def measures() -> dict[str, Callable[[Any], dict[str, rows.Figure]]]:
    """What an option has measured, given its value."""
    return {
        "loaded": lambda count: {"G13": loop.ticks_under_load(count)},
        "steps": lambda count: core("laws", "guarantees", TAUTSCOPE_STEPS=count),
        "ticks": lambda count: core("no_alloc", "allocate", TAUTSCOPE_TICKS=count),
        "hours": lambda hours: core("soak", "", TAUTSCOPE_HOURS=hours),
        "stalls": lambda count: {"G14": rows.stalls(count)},
        "replays": lambda count: {"G19": rows.replays(count)},
        "kills": lambda count: {"G16": kills(count)},
        "cuts": lambda every: {"G18": logs.cuts(every)},
        "disks": lambda _: {"G17": logs.disks()},
        "function": lambda _: {"G24": loop.function()},
        "code": lambda _: {"G22": code()},
        "mutants": lambda _: {"G22b": mutants()},
        "campaign": lambda files: rows.campaign(whole(files)),
        "each": lambda files: {"G7": rows.each_off(read(files))},
    }


def main() -> None:
    options = arguments()
    found: dict[str, rows.Figure] = {}
    for name, measure in measures().items():
        if wanted := getattr(options, name):
            begin = time.monotonic()
            found |= measure(wanted)
            print(f"{name}: {time.monotonic() - begin:.0f} s", file=sys.stderr, flush=True)
    text = table(found)
    print(text)
    if options.write:
        insert(PAGE, "guarantees", text)


def whole(files: Iterable[Path]) -> list[rows.Row]:
    """The rows of the campaign with all guards."""
    return [row for part in read(files).values() for row in part]


def core(test: str, only: str, **wanted: float) -> dict[str, rows.Figure]:
    """What a test of the core prints; it counts allocations only with its assertions on."""
    command = ["cargo", "test", "--profile", "proof", "-p", "tautscope-core", "--test", test, only]
    done = subprocess.run(
        [*command, "--", "--nocapture", "--test-threads", "1"],
        cwd=ROOT,
        env=os.environ | {name: str(value) for name, value in wanted.items()},
        capture_output=True,
        text=True,
        check=False,
    )
    found = printed(done.stdout)
    if not found:
        raise RuntimeError(done.stderr)
    return found


UNITS = {
    "G1": "{:.2g} last places over",
    "G2": "exact",
    "G3": "{:.2g} mm",
    "G4": "{:.2g} mm",
    "G12": "none",
    "G15": "the tip's error is {:.2f} times what it was",
}


def printed(text: str) -> dict[str, rows.Figure]:
    """What those tests say: goal, law, number, how many missed it, worst."""
    said = re.findall(r"\b(G\d+) (paper|best|both) (\d+) (\d+) (\S+)$", text, re.MULTILINE)
    found: dict[str, rows.Figure] = {}
    for name, law, number, broken, worst in said:
        figure = rows.Figure(f"{law}: {UNITS[name].format(float(worst))}", number, int(broken))
        found[name] = found[name].beside(figure) if name in found else figure
    return found


def kills(count: int) -> rows.Figure:
    """G16: recordings of a process that is killed."""
    command = [sys.executable, "benchmarks/recordings.py", "--kills", str(count)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
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


def mutants() -> rows.Figure:
    """What .cargo/mutants.toml has broken; docs/mutants.md says what may survive, and why."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["cargo", "mutants", "-p", "tautscope-core", "-o", folder]
        subprocess.run(command, cwd=ROOT, check=False)
        found = Path(folder) / "mutants.out"
        counts = {
            name: len((found / f"{name}.txt").read_text(encoding="utf-8").splitlines())
            for name in ("caught", "missed", "timeout", "unviable")
        }
    text = ", ".join(f"{number} {name}" for name, number in counts.items())
    return rows.Figure(text, str(sum(counts.values())), counts["missed"])


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
    return f"{start} {figure.text} | {figure.runs} | {figure.failures} | {figure.seeds} | {today} |"


if __name__ == "__main__":
    main()
