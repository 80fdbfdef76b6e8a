"""Goals of reliability, each with its result, in one table of docs/safety.md.

Measures only what the options request; `--write` keeps the other rows of the table.

    uv run python benchmarks/guarantees --minutes 60 --write
    uv run python benchmarks/guarantees --steps 1000000000 --hours 1000 --write
    uv run python benchmarks/guarantees --campaign rows.json --each each.json --write
"""

import argparse
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from common.paths import ROOT
from faults.campaign import read
from guarantees import campaign, external, goals, logs, loop, mutants, timeouts
from guarantees.goals import Measurement


@dataclass(frozen=True)
class Size:
    """Size of a measurement.

    Attributes:
        goal: Size that the goal requires; for `cuts`, the step between two.
        seconds: Duration on an idle machine, waiting included.
    """

    goal: float
    seconds: float


SIZES = {
    "steps": Size(1_000_000_000, 3_200),
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
    """Return the sizes that fit: short measurements whole, the others with equal time."""
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

    count("steps", "G1 to G4: steps of the tests in Rust; the goal is 1000000000")
    count("ticks", "G12: ticks of the test in Rust; 1000000")
    count("hours", "G15: hours of the soak test in Rust; 1000", float)
    count("loaded", "G13: ticks under load; 100000")
    count("stalls", "G14: stalls; 10000")
    count("silences", "G10c: silences of the input device; 1000")
    count("heartbeats", "G10d: lost heartbeats on the simulated bus; 100")
    count("replays", "G19: repeated runs; 256")
    count("kills", "G16: killed recordings; 1000")
    count("cuts", "G18: a log cut at every N-th byte; 1")
    count("mutants", "G22b: minutes of cargo mutants, which continues where it stopped", float)
    parser.add_argument("--disks", action="store_true", help="G17: bad disks")
    parser.add_argument("--function", action="store_true", help="G24: reduction and tracking")
    parser.add_argument("--code", action="store_true", help="G22: checks of the compiler")
    count("minutes", "all of these in about N minutes; 180 measures every goal whole", float)
    parser.add_argument(
        "--campaign", type=Path, nargs="+", help="G5 to G10, G23: rows of benchmarks/faults"
    )
    parser.add_argument(
        "--each", type=Path, nargs="+", help="G7: rows of benchmarks/faults --off each"
    )
    parser.add_argument(
        "--write", action="store_true", help=f"update {goals.PAGE.relative_to(ROOT)}"
    )
    options = parser.parse_args()
    if options.minutes:
        for name, value in sizes(options.minutes).items():
            kind = type(getattr(options, name))
            setattr(options, name, getattr(options, name) or kind(value))
    return options


core_test = external.run_core_test
MEASURE: dict[str, Callable[[Any], dict[str, Measurement]]] = {
    "loaded": lambda count: {"G13": loop.ticks_under_load(count)},
    "steps": lambda count: core_test("--lib", "properties::guarantees", TAUTSCOPE_STEPS=count),
    "ticks": lambda count: core_test("--test no_alloc", "allocate", TAUTSCOPE_TICKS=count),
    "hours": lambda hours: core_test("--test soak", "", TAUTSCOPE_HOURS=hours),
    "stalls": lambda count: {"G14": loop.stalls(count)},
    "silences": lambda count: {"G10c": timeouts.input_silent(count)},
    "heartbeats": lambda count: {"G10d": timeouts.heartbeat_lost(count)},
    "replays": lambda count: {"G19": loop.replays(count)},
    "kills": lambda count: {"G16": external.kills(count)},
    "cuts": lambda every: {"G18": logs.cuts(every)},
    "disks": lambda _: {"G17": logs.disks()},
    "function": lambda _: {"G24": loop.performance()},
    "code": lambda _: {"G22": external.compiler_checks()},
    "mutants": lambda minutes: {"G22b": mutants.mutants(minutes)},
    "campaign": lambda files: campaign.measure(
        [row for part in read(files).values() for row in part]
    ),
    "each": lambda files: {"G7": campaign.measure_each_off(read(files))},
}
"""What measures the goals of each option, given its value."""


def main() -> None:
    options = arguments()
    found: dict[str, Measurement] = {}
    for name, measure in MEASURE.items():
        if wanted := getattr(options, name):
            print(f"{name} {wanted} ...", file=sys.stderr, flush=True)
            begin, used = time.monotonic(), _processor_time()
            found |= measure(wanted)
            took = f"{time.monotonic() - begin:.0f} s, {_processor_time() - used:.0f} s of a core"
            print(f"{name} {wanted}: {took}", file=sys.stderr, flush=True)
            if options.write:
                # Written at once: an interrupted call keeps what it has measured.
                goals.write(found)
    print(goals.table(found))


def _processor_time() -> float:
    """Return the processor time of this process and its children so far [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


if __name__ == "__main__":
    main()
