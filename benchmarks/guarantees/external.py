"""Goals that other programs measure: tests of the core, the compiler, and killed processes."""

import json
import os
import re
import subprocess
import sys

from common.paths import ROOT
from guarantees.goals import Measurement

UNITS = {
    "G1": "{:.2g} last places over",
    "G2": "exact",
    "G3": "{:.2g} mm",
    "G4": "{:.2g} mm",
    "G12": "none",
    "G15": "{:.2f} times the tip's error",
}
"""Format of the worst value that a test of the core prints."""


def run_core_test(test: str, only: str, **variables: float) -> dict[str, Measurement]:
    """Run a test of the core, with the assertions that count allocations, and read its results."""
    command = ["cargo", "test", "--profile", "proof", "-p", "tautscope-core", *test.split(), only]
    done = subprocess.run(
        [*command, "--", "--nocapture", "--test-threads", "1"],
        cwd=ROOT,
        env=os.environ | {name: str(value) for name, value in variables.items()},
        stdout=subprocess.PIPE,
        text=True,
        check=False,
    )
    found = parse_results(done.stdout)
    if not found:
        raise RuntimeError(done.stdout)
    return found


def parse_results(text: str) -> dict[str, Measurement]:
    """Parse the results that the tests print: goal, law, number, failures, worst value."""
    results = re.findall(
        r"\b(G\d+) (paper|best|both|recovering) (\d+) (\d+) (\S+)$", text, re.MULTILINE
    )
    found: dict[str, Measurement] = {}
    for name, law, number, failures, worst in results:
        text = f"{law}: {UNITS[name].format(float(worst))}"
        measured = Measurement(text, number, int(failures))
        found[name] = found[name].join(measured) if name in found else measured
    return found


def kills(count: int) -> Measurement:
    """Measure G16: recordings of killed processes."""
    command = [sys.executable, "benchmarks/recordings", "--kills", str(count)]
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    facts = json.loads(done.stdout)
    text = f"{facts['readable']} readable, {facts['lost_max_s']} s lost at most"
    return Measurement(text, str(count), facts["failed"], "0")


def compiler_checks() -> Measurement:
    """Measure G22: what the compiler denies, and that the core compiles with it."""
    manifest = (ROOT / "Cargo.toml").read_text(encoding="utf-8")
    library = (ROOT / "crates/core/src/lib.rs").read_text(encoding="utf-8")
    required = ("unwrap_used", "expect_used", "panic", "indexing_slicing")
    missing = [name for name in required if f"clippy::{name}" not in library]
    missing += [] if re.search(r'unsafe_code = "forbid"', manifest) else ["unsafe_code"]
    command = ["cargo", "clippy", "-p", "tautscope-core", "--quiet", "--", "-D", "warnings"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    missing += ["clippy"] if done.returncode else []
    return Measurement("not denied: " + (", ".join(missing) or "none"), "1", len(missing))
