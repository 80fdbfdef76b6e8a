"""Mutation testing (G22b), in parts that add up."""

import hashlib
import json
import os
import re
import signal
import subprocess
import time
import tomllib
from collections import Counter
from pathlib import Path

from common.paths import ROOT
from guarantees.goals import Measurement

STEPS = "50000"
"""Random steps of each property test; enough to detect a mutant, and quick."""
KINDS = ("caught", "missed", "timeout", "unviable")
BASELINE_FAILED = 4
"""Exit status of cargo-mutants if the tests fail without a mutant."""
KEPT = ROOT / "target" / "guarantees"
CONFIG = ROOT / ".cargo" / "mutants.toml"
LIST = ("cargo", "mutants", "-p", "tautscope-core")
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.toml")
"""Mutants that no test can distinguish from the original, the line that each changes, and why."""


def mutants(minutes: float) -> Measurement:
    """Test the mutants of .cargo/mutants.toml for at most so many minutes.

    A state is the content of all files that mutants and their tests depend on. Its results are
    kept in a folder of target/guarantees, where the next call continues. Results of an earlier
    state count for files that have not changed, until they are repeated. The order is: mutants
    that are unknown or were missed, then those with a result of an earlier state only.
    """
    listed = subprocess.run([*LIST, "--list"], cwd=ROOT, capture_output=True, text=True, check=True)
    everyone = listed.stdout.splitlines()
    files = _files(everyone)
    folder = KEPT / f"mutants-{_state()}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "files.json").write_text(json.dumps(files, indent=1), "utf-8")
    end = time.monotonic() + 60 * minutes
    for kinds in (("missed",), ("caught", "timeout", "unviable")):
        earlier, now = _earlier(folder, files), _known(folder)
        wanted = [name for name in everyone if name not in now]
        wanted = [name for name in wanted if earlier.get(name, "missed") in kinds]
        if wanted and time.monotonic() < end:
            _test(wanted, folder, end - time.monotonic())
    return summarise(everyone, _known(folder), _earlier(folder, files))


def summarise(everyone: list[str], now: dict[str, str], earlier: dict[str, str]) -> Measurement:
    """Count the results of this state, or else of an earlier one."""
    explained = tomllib.loads(EQUIVALENT.read_text("utf-8"))["mutant"]
    reasons = {(each["name"], each["line"]) for each in explained}
    both = earlier | now
    known = {name: both[name] for name in everyone if name in both}
    survived = [name for name, kind in known.items() if kind == "missed"]
    missed = [name for name in survived if _place(name) not in reasons]
    counts = Counter(known.values())
    text = ", ".join(f"{counts[kind]} {kind}" for kind in KINDS)
    if excused := len(survived) - len(missed):
        text += f", {excused} of the missed explained"
    if old := sum(name not in now for name in known):
        text += f"; {old} of them tested before other files changed"
    if rest := sorted({_file(name) for name in everyone if name not in known}):
        text += f"; of {len(everyone)}, not yet all of {len(rest)} files"
    return Measurement(text, str(len(known)), len(missed))


def _state() -> str:
    """Return a hash of all files that mutants and their tests depend on."""
    files = [CONFIG, *sorted((ROOT / "crates" / "core").rglob("*.rs"))]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:12]


def _files(everyone: list[str]) -> dict[str, str]:
    """Return the hash of each file that has mutants."""
    names = sorted({_file(name) for name in everyone})
    return {name: hashlib.sha256((ROOT / name).read_bytes()).hexdigest() for name in names}


def _test(wanted: list[str], folder: Path, seconds: float) -> None:
    """Test these mutants until the time is over; `_known` reads the results."""
    config = folder / "mutants.toml"
    chosen = "".join(f"  {json.dumps('^' + re.escape(name) + '$')},\n" for name in wanted)
    config.write_text(f"examine_re = [\n{chosen}]\n{CONFIG.read_text('utf-8')}", "utf-8")
    # One build folder, because the mutated copy has another path each time.
    environment = {
        "TAUTSCOPE_STEPS": STEPS,
        "CARGO_TARGET_DIR": str(KEPT / "builds"),
        "RUSTC_BOOTSTRAP": "1",
        # A failure is enough; nobody reads its smallest example.
        "PROPTEST_MAX_SHRINK_ITERS": "0",
    }
    command = [*LIST, "--config", str(config), "-o", str(folder)]
    running = subprocess.Popen(command, cwd=ROOT, env=os.environ | environment)
    try:
        running.wait(seconds)
    except (subprocess.TimeoutExpired, KeyboardInterrupt):
        running.send_signal(signal.SIGINT)
        running.wait()
    if running.returncode == BASELINE_FAILED:
        raise RuntimeError(f"the tests fail without a mutant: see {folder}/mutants.out/log")


def _known(folder: Path) -> dict[str, str]:
    """Return all results so far, and save them: the next call overwrites those of cargo-mutants."""
    kept = folder / "known.json"
    known: dict[str, str] = json.loads(kept.read_text("utf-8")) if kept.exists() else {}
    for kind in KINDS:
        names = folder / "mutants.out" / f"{kind}.txt"
        if names.exists():
            known |= dict.fromkeys(names.read_text("utf-8").splitlines(), kind)
    kept.write_text(json.dumps(known, indent=1), "utf-8")
    return known


def _earlier(folder: Path, files: dict[str, str]) -> dict[str, str]:
    """Return the results of other states for files as they are now; the latest state counts."""
    states = [path.parent for path in KEPT.glob("mutants-*/files.json") if path.parent != folder]
    found: dict[str, str] = {}
    for state in sorted(states, key=lambda state: (state / "files.json").stat().st_mtime):
        then = json.loads((state / "files.json").read_text("utf-8"))
        same = {name for name, text in files.items() if then.get(name) == text}
        found |= {name: kind for name, kind in _known(state).items() if _file(name) in same}
    return found


def _place(mutant: str) -> tuple[str, str]:
    """Return a mutant without its line number, and the line that it changes."""
    file, line, _, what = mutant.split(":", 3)
    text = (ROOT / file).read_text("utf-8").splitlines()[int(line) - 1]
    return f"{file}:{what}", text.strip()


def _file(mutant: str) -> str:
    return mutant.partition(":")[0]
