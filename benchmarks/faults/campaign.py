"""Command line of the fault campaign, and its runs in parallel."""

import argparse
import json
import math
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

from common.doc_pages import find
from common.paths import ROOT
from common.processes import Results, add_arguments, run_until_stopped
from faults import tables
from faults.runs import run_seed, run_with_each_off
from faults.scenarios import DURATION, OBSERVED_AFTER, OBSERVED_PERMANENT
from tautscope.config import Profile
from tautscope.loop.safety import DETECTORS
from tautscope.twin.faults import KINDS

PAGE = ROOT / "docs" / "faults.md"
RUNS = 20_000
DETECTOR_RUNS = 2_000
"""Runs per detector that is off; most need no simulation, see `faults.runs.run_with_each_off`."""

Options = argparse.Namespace
Found = dict[str, list[tables.Row]]
"""Rows by what is off: names of detectors; ``-name`` in a campaign with each off in turn."""


def arguments() -> Options:
    parser = argparse.ArgumentParser(
        description="Simulate runs with faults: how far the tip moves, and whether the loop "
        "detects them.",
    )
    parser.add_argument(
        "--runs",
        type=int,
        help=f"smallest number of runs [{RUNS}, {DETECTOR_RUNS} for each detector]",
    )
    parser.add_argument("--first-seed", type=int, default=0, help="[%(default)s]")
    parser.add_argument("--seed", type=int, help="only this seed")
    parser.add_argument(
        "--kind", action="append", choices=KINDS, metavar="KIND", help="only this kind [all]"
    )
    parser.add_argument("--profile", choices=("paper", "best"), default="best", help="[best]")
    parser.add_argument(
        "--off",
        default="",
        help='detectors that are off, separated by commas; "each": each in turn; "all": all',
    )
    parser.add_argument(
        "--longest",
        type=float,
        default=DURATION[1],
        help="longest transient fault, 6 at most, not with --off each [%(default)s s]",
    )
    parser.add_argument("--shard", default="1/1", metavar="I/N", help="part I of N of the seeds")
    add_arguments(parser)
    parser.add_argument("--json", type=Path, metavar="FILE", help="save a row for every run")
    parser.add_argument(
        "--read", type=Path, nargs="+", metavar="FILE", help="read saved rows, simulate nothing"
    )
    parser.add_argument(
        "--write", action="store_true", help=f"update the tables of {PAGE.relative_to(ROOT)}"
    )
    options = parser.parse_args()
    if not DURATION[0] < options.longest <= OBSERVED_PERMANENT - OBSERVED_AFTER:
        parser.error("--longest: above 0.1, 6 at most")
    if options.off == "each" and options.longest != DURATION[1]:
        parser.error("--longest is not for --off each")
    if options.write and not options.read:
        if options.kind or options.seed is not None or options.shard != "1/1":
            parser.error(
                "--write updates whole tables: use it without --kind, --seed and --shard, or with "
                "--read"
            )
        try:
            find(PAGE, section(options, {"all": "unguarded"}.get(options.off, options.off)))
        except ValueError as error:
            parser.error(f"--write: {error}")
    return options


def section(options: Options, name: str) -> str:
    """Return the section of the page for the rows of what is off."""
    return f"faults {'long' if options.longest != DURATION[1] else name or 'guarded'}"


def measure(options: Options) -> Results[int, Found]:
    """Run a campaign; Ctrl-C ends it with the seeds that are finished."""
    runs = options.runs or (DETECTOR_RUNS if options.off == "each" else RUNS)
    seeds, kinds = select_seeds(options, runs), options.kind or list(KINDS)
    simulate = partial(
        rows_of_seed,
        kinds=kinds,
        profile=options.profile,
        off=options.off,
        longest=options.longest,
    )
    if len(seeds) == 1:
        return Results({seeds[0]: simulate(seeds[0])})
    return run_until_stopped(simulate, seeds, options, "faults")


def select_seeds(options: Options, runs: int) -> list[int]:
    """Return the seeds of this shard."""
    if options.seed is not None:
        return [options.seed]
    part, parts = (int(number) for number in options.shard.split("/"))
    count = math.ceil(runs / len(options.kind or KINDS))
    return list(range(options.first_seed, options.first_seed + count))[part - 1 :: parts]


def rows_of_seed(
    seed: int, *, kinds: Sequence[str], profile: Profile, off: str, longest: float
) -> Found:
    """Return the rows of one seed."""
    if off == "each":
        outcomes = run_with_each_off(seed, kinds, profile)
        found = {f"-{name}": each for name, each in outcomes.items()}
    else:
        names = DETECTORS if off == "all" else tuple(filter(None, off.split(",")))
        name = "unguarded" if off == "all" else off
        found = {name: run_seed(seed, kinds, profile, names, longest)}
    return {name: [tables.to_row(run, profile) for run in runs] for name, runs in found.items()}


def merge(parts: Iterable[Found]) -> Found:
    """Return the rows of several seeds, or files, together."""
    merged: Found = {}
    for part in parts:
        for name, rows in part.items():
            merged.setdefault(name, []).extend(rows)
    return merged


def read(files: Iterable[Path]) -> Found:
    """Read saved rows, and classify them by the present goals."""
    found = merge(json.loads(file.read_text(encoding="utf-8")) for file in files)
    return {name: [tables.with_verdict(row) for row in rows] for name, rows in found.items()}
