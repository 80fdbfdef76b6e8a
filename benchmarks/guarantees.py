"""The goals of reliability, each with its figure, in one table of docs/safety.md.

Only what is asked for is measured; `--write` leaves the rows of the others as they are.

    uv run python benchmarks/guarantees.py --steps 1000000000 --stalls 10000 --replays 256 --write
    uv run python benchmarks/guarantees.py --campaign rows.json --each each.json --write
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

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
    Goal("G12", "allocation in the tick", "none"),
    Goal("G13", "time of a tick under load", "p99.99 100 us, at most 1 ms"),
    Goal("G14", "command's step after a stall of 5 ms to 2 s", "at most v_max dt"),
    Goal("G15", "soak, 1000 h", "no growth"),
    Goal("G16", "recordings killed", "all readable, 100 ms lost at most"),
    Goal("G17", "disk full, slow, failing", "no tick missed"),
    Goal("G18", "logs cut at every byte, and a bit flipped", "no crash, whole chunks read"),
    Goal("G19", "the same run again", "to the bit"),
    Goal("G22", "unsafe, unwrap, panic, indexing in the core", "denied by the compiler"),
    Goal("G23", "spurious holds of nominal use", "at most 1 per hour"),
    Goal("G24", "reduction under guards", "at least 75 %"),
)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=0, metavar="N", help="G1 to G4, in Rust")
    parser.add_argument("--stalls", type=int, default=0, metavar="N", help="G14")
    parser.add_argument("--replays", type=int, default=0, metavar="N", help="G19")
    parser.add_argument("--kills", type=int, default=0, metavar="N", help="G16")
    parser.add_argument("--cuts", type=int, default=0, metavar="N", help="G18: every N-th byte")
    parser.add_argument("--campaign", type=Path, nargs="+", help="G5 to G10, G23: of faults.py")
    parser.add_argument("--each", type=Path, nargs="+", help="G7: of faults.py --off each")
    parser.add_argument("--code", action="store_true", help="G12, G22: what the compiler checks")
    parser.add_argument("--write", action="store_true", help=f"into {PAGE.relative_to(ROOT)}")
    return parser.parse_args()


def main() -> None:
    options = arguments()
    found: dict[str, rows.Figure] = {}
    if options.steps:
        found |= steps(options.steps)
    if options.stalls:
        found["G14"] = rows.stalls(options.stalls)
    if options.replays:
        found["G19"] = rows.replays(options.replays)
    if options.kills:
        found["G16"] = kills(options.kills)
    if options.cuts:
        found["G18"] = rows.cuts(options.cuts)
    if options.campaign:
        found |= rows.campaign(whole(options.campaign))
    if options.each:
        found["G7"] = rows.each_off(read(options.each))
    if options.code:
        found |= code()
    text = table(found)
    print(text)
    if options.write:
        insert(PAGE, "guarantees", text)


def whole(files: Iterable[Path]) -> list[rows.Row]:
    """The rows of the campaign with all guards."""
    return [row for part in read(files).values() for row in part]


def steps(count: int) -> dict[str, rows.Figure]:
    """G1 to G4: what the tests of the core print."""
    command = ["cargo", "test", "--release", "-p", "tautscope-core", "--test", "laws"]
    done = subprocess.run(
        [*command, "guarantees", "--", "--nocapture", "--test-threads", "1"],
        cwd=ROOT,
        env=os.environ | {"TAUTSCOPE_STEPS": str(count)},
        capture_output=True,
        text=True,
        check=False,
    )
    return printed(done.stdout)


def printed(text: str) -> dict[str, rows.Figure]:
    """What those tests say."""
    said = re.findall(r"\b(G\d) (paper|best) (\d+) (\d+) (\S+)$", text, re.MULTILINE)
    units = {"G1": "{:.2g} last places over", "G2": "exact", "G3": "{:.2g} mm", "G4": "{:.2g} mm"}
    found: dict[str, rows.Figure] = {}
    for name, law, number, broken, worst in said:
        figure = rows.Figure(f"{law}: {units[name].format(float(worst))}", number, int(broken))
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


def code() -> dict[str, rows.Figure]:
    """What the compiler denies, and the test that counts allocations."""
    command = ["cargo", "test", "-p", "tautscope-core", "--test", "no_alloc"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    manifest = (ROOT / "Cargo.toml").read_text(encoding="utf-8")
    library = (ROOT / "crates/core/src/lib.rs").read_text(encoding="utf-8")
    wanted = ("unwrap_used", "expect_used", "panic", "indexing_slicing")
    missing = [name for name in wanted if f"clippy::{name}" not in library]
    missing += [] if re.search(r'unsafe_code = "forbid"', manifest) else ["unsafe_code"]
    return {
        "G12": rows.Figure("`crates/core/tests/no_alloc.rs`", "1", int(done.returncode != 0)),
        "G22": rows.Figure("not denied: " + (", ".join(missing) or "none"), "1", len(missing)),
    }


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
