"""Lines broken on purpose: G22b, in parts that add up."""

from __future__ import annotations

import hashlib
import json
import os
import re
import signal
import subprocess
from collections import Counter
from pathlib import Path

from doc_pages import ROOT
from guarantee_rows import Figure

STEPS = "50000"
"""Random steps of each law; enough to break it, and quick."""
KINDS = ("caught", "missed", "timeout", "unviable")
EQUIVALENT = re.compile(r"^- `(?P<mutant>crates/.+)`", re.MULTILINE)
"""Mutants that docs/mutants.md gives a reason for."""


def mutants(minutes: float) -> Figure:
    """What .cargo/mutants.toml has broken, for so many minutes at most.

    What is known is kept in target/guarantees, and the next call goes on from there; a file of the
    core that has changed begins anew.
    """
    command = ["cargo", "mutants", "-p", "tautscope-core"]
    listed = subprocess.run(
        [*command, "--list"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    everyone = listed.stdout.splitlines()
    folder = ROOT / "target" / "guarantees" / f"mutants-{_print()}"
    folder.mkdir(parents=True, exist_ok=True)
    known = _known(folder)
    if len(known) < len(everyone):
        _go_on([*command, "--iterate", "-o", str(folder)], minutes)
        known = _known(folder)
    return figure(everyone, known)


def figure(everyone: list[str], known: dict[str, str]) -> Figure:
    """Of all that there are, what became of those that were tried."""
    page = (ROOT / "docs" / "mutants.md").read_text(encoding="utf-8")
    reasons = {found["mutant"] for found in EQUIVALENT.finditer(page)}
    missed = [name for name, kind in known.items() if kind == "missed" and name not in reasons]
    counts = Counter(known.values())
    text = ", ".join(f"{counts[kind]} {kind}" for kind in KINDS)
    if excused := counts["missed"] - len(missed):
        text += f", {excused} of the missed with a reason"
    if rest := sorted({_file(name) for name in everyone if name not in known}):
        text += f"; of {len(everyone)}, not yet all of {', '.join(rest)}"
    return Figure(text, str(len(known)), len(missed))


def _print() -> str:
    """Of all that mutants and the tests against them are made of."""
    files = [ROOT / ".cargo" / "mutants.toml", *sorted((ROOT / "crates" / "core").rglob("*.rs"))]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:12]


def _go_on(command: list[str], minutes: float) -> None:
    # One folder of builds: the copy that is broken has another path each time.
    builds = ROOT / "target" / "guarantees" / "builds"
    environment = {"TAUTSCOPE_STEPS": STEPS, "CARGO_TARGET_DIR": str(builds)}
    running = subprocess.Popen(command, cwd=ROOT, env=os.environ | environment)
    try:
        running.wait(60 * minutes)
    except (subprocess.TimeoutExpired, KeyboardInterrupt):
        running.send_signal(signal.SIGINT)
        running.wait()


def _known(folder: Path) -> dict[str, str]:
    """What became of each mutant so far; kept beside, as the next call writes its files anew."""
    kept = folder / "known.json"
    known: dict[str, str] = json.loads(kept.read_text("utf-8")) if kept.exists() else {}
    for kind in KINDS:
        names = folder / "mutants.out" / f"{kind}.txt"
        if names.exists():
            known |= dict.fromkeys(names.read_text("utf-8").splitlines(), kind)
    kept.write_text(json.dumps(known, indent=1), "utf-8")
    return known


def _file(mutant: str) -> str:
    return Path(mutant.partition(":")[0]).name
