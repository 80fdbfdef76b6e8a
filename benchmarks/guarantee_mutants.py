"""Lines broken on purpose: G22b, in parts that add up."""

from __future__ import annotations

import hashlib
import json
import os
import re
import signal
import subprocess
import time
from collections import Counter
from pathlib import Path

from doc_pages import ROOT
from guarantee_rows import Figure

STEPS = "50000"
"""Random steps of each law; enough to break it, and quick."""
KINDS = ("caught", "missed", "timeout", "unviable")
BASELINE_FAILED = 4
"""How cargo-mutants ends then."""
KEPT = ROOT / "target" / "guarantees"
CONFIG = ROOT / ".cargo" / "mutants.toml"
LIST = ("cargo", "mutants", "-p", "tautscope-core")
EQUIVALENT = re.compile(r"^- `(?P<mutant>crates/.+?)`,\s+`(?P<line>.+?)`:", re.MULTILINE)
"""Mutants that docs/mutants.md gives a reason for, and the line each breaks, wherever it stands."""


def mutants(minutes: float) -> Figure:
    """What .cargo/mutants.toml has broken, for so many minutes at most.

    A state is all that mutants and the tests against them are made of; its folder of
    target/guarantees keeps what is known of it, and the next call goes on from there. What an
    earlier state found of a file that has not changed since counts until it is found anew: first
    comes what is unknown or was missed, then what only an earlier state knows.
    """
    listed = subprocess.run([*LIST, "--list"], cwd=ROOT, capture_output=True, text=True, check=True)
    everyone = listed.stdout.splitlines()
    files = _files(everyone)
    folder = KEPT / f"mutants-{_print()}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "files.json").write_text(json.dumps(files, indent=1), "utf-8")
    end = time.monotonic() + 60 * minutes
    for kinds in (("missed",), ("caught", "timeout", "unviable")):
        earlier, now = _earlier(folder, files), _known(folder)
        wanted = [name for name in everyone if name not in now]
        wanted = [name for name in wanted if earlier.get(name, "missed") in kinds]
        if wanted and time.monotonic() < end:
            _try(wanted, folder, end - time.monotonic())
    return figure(everyone, _known(folder), _earlier(folder, files))


def figure(everyone: list[str], now: dict[str, str], earlier: dict[str, str]) -> Figure:
    """What became of those that were tried, in this state or else in an earlier one."""
    page = (ROOT / "docs" / "mutants.md").read_text(encoding="utf-8")
    reasons = {(found["mutant"], found["line"]) for found in EQUIVALENT.finditer(page)}
    both = earlier | now
    known = {name: both[name] for name in everyone if name in both}
    survived = [name for name, kind in known.items() if kind == "missed"]
    missed = [name for name in survived if _place(name) not in reasons]
    counts = Counter(known.values())
    text = ", ".join(f"{counts[kind]} {kind}" for kind in KINDS)
    if excused := len(survived) - len(missed):
        text += f", {excused} of the missed with a reason"
    if old := sum(name not in now for name in known):
        text += f"; {old} of them tried before other files changed"
    if rest := sorted({_file(name) for name in everyone if name not in known}):
        text += f"; of {len(everyone)}, not yet all of {', '.join(map(_base, rest))}"
    return Figure(text, str(len(known)), len(missed))


def _print() -> str:
    """Of all that mutants and the tests against them are made of."""
    files = [CONFIG, *sorted((ROOT / "crates" / "core").rglob("*.rs"))]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:12]


def _files(everyone: list[str]) -> dict[str, str]:
    """The print of each file that is broken."""
    names = sorted({_file(name) for name in everyone})
    return {name: hashlib.sha256((ROOT / name).read_bytes()).hexdigest() for name in names}


def _try(wanted: list[str], folder: Path, seconds: float) -> None:
    """These, until the time is over; `_known` finds what became of them."""
    config = folder / "mutants.toml"
    chosen = "".join(f"  {json.dumps('^' + re.escape(name) + '$')},\n" for name in wanted)
    config.write_text(f"examine_re = [\n{chosen}]\n{CONFIG.read_text('utf-8')}", "utf-8")
    # One folder of builds: the copy that is broken has another path each time.
    environment = {
        "TAUTSCOPE_STEPS": STEPS,
        "CARGO_TARGET_DIR": str(KEPT / "builds"),
        "RUSTC_BOOTSTRAP": "1",
    }
    command = [*LIST, "--config", str(config), "-o", str(folder)]
    running = subprocess.Popen(command, cwd=ROOT, env=os.environ | environment)
    try:
        running.wait(seconds)
    except (subprocess.TimeoutExpired, KeyboardInterrupt):
        running.send_signal(signal.SIGINT)
        running.wait()
    if running.returncode == BASELINE_FAILED:
        raise RuntimeError(f"nothing is broken yet and the tests fail: {folder}/mutants.out/log")


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


def _earlier(folder: Path, files: dict[str, str]) -> dict[str, str]:
    """What other states found of files as they are now, the latest of them last to speak."""
    states = [path.parent for path in KEPT.glob("mutants-*/files.json") if path.parent != folder]
    found: dict[str, str] = {}
    for state in sorted(states, key=lambda state: (state / "files.json").stat().st_mtime):
        then = json.loads((state / "files.json").read_text("utf-8"))
        same = {name for name, text in files.items() if then.get(name) == text}
        found |= {name: kind for name, kind in _known(state).items() if _file(name) in same}
    return found


def _place(mutant: str) -> tuple[str, str]:
    """A mutant without where it stands, and the line that it breaks."""
    file, line, _, what = mutant.split(":", 3)
    text = (ROOT / file).read_text("utf-8").splitlines()[int(line) - 1]
    return f"{file}:{what}", text.strip()


def _file(mutant: str) -> str:
    return mutant.partition(":")[0]


def _base(file: str) -> str:
    return Path(file).name
