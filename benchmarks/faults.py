"""The fault campaign: what faults do to the tip, and whether they are noticed.

Every run is compared with the run without the fault: same instrument, noise and motion. 10 mm of
slack, K_b = 5, a hand at up to 12.6 mm/s, the slack learnt. `--kind K --seed S` repeats one row.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

import fault_tables as tables
from doc_pages import ROOT, insert
from fault_runs import each_off, study
from hysteresis_runs import one_thread
from tautscope.commands.progress import progress_bar
from tautscope.config import Profile
from tautscope.loop.safety import DETECTORS
from tautscope.twin.faults import KINDS

PAGE = ROOT / "docs" / "faults.md"
RUNS = 20_000
DETECTOR_RUNS = 2_000
"""For each detector that is switched off; most need not be made, see `fault_runs.each_off`."""


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--runs",
        type=int,
        help=f"at least [{RUNS}, {DETECTOR_RUNS} for each detector]",
    )
    parser.add_argument("--first-seed", type=int, default=0, help="[%(default)s]")
    parser.add_argument("--seed", type=int, help="only this one")
    parser.add_argument(
        "--kind", action="append", choices=KINDS, metavar="KIND", help="only this one [all]"
    )
    parser.add_argument("--profile", choices=("paper", "best"), default="best", help="[best]")
    parser.add_argument(
        "--off", default="", help="detectors switched off, by comma; each: each in turn; all"
    )
    parser.add_argument("--shard", default="1/1", metavar="I/N", help="this part of the seeds")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="[all cores]")
    parser.add_argument("--json", type=Path, metavar="FILE", help="every run, a row")
    parser.add_argument(
        "--read", type=Path, nargs="+", metavar="FILE", help="rows of --json in place of runs"
    )
    parser.add_argument("--write", action="store_true", help=f"into {PAGE.relative_to(ROOT)}")
    return parser.parse_args()


Found = dict[str, list[tables.Row]]
"""Rows by what is switched off, ``-name`` for one of all detectors in turn."""


def campaign(
    seeds: Sequence[int],
    one: Callable[[int], Found],
    workers: int,
    tell: Callable[[float], None] = lambda _: None,
) -> Found:
    """The rows of many seeds, in the order of the seeds."""
    found: dict[int, Found] = {}
    with ProcessPoolExecutor(
        workers, mp_context=multiprocessing.get_context("spawn"), initializer=one_thread
    ) as pool:
        running = {pool.submit(one, seed): seed for seed in seeds}
        try:
            for done in as_completed(running):
                found[running[done]] = done.result()
                tell(len(found) / len(seeds))
        except KeyboardInterrupt:
            # What is done is worth having.
            pool.shutdown(cancel_futures=True)
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return together(found[seed] for seed in seeds if seed in found)


def together(parts: Iterable[Found]) -> Found:
    """Rows of several seeds, or files."""
    whole: Found = {}
    for part in parts:
        for name, each in part.items():
            whole.setdefault(name, []).extend(each)
    return whole


def rows(seed: int, *, kinds: Sequence[str], profile: Profile, off: str) -> Found:
    """Those of one seed."""
    if off == "each":
        found = {f"-{name}": each for name, each in each_off(seed, kinds, profile).items()}
    else:
        names = DETECTORS if off == "all" else tuple(filter(None, off.split(",")))
        name = "unguarded" if off == "all" else off
        found = {name: study(seed, kinds, profile, names)}
    return {name: [tables.to_row(run, profile) for run in runs] for name, runs in found.items()}


def chosen(options: argparse.Namespace, runs: int) -> list[int]:
    """The seeds of this part."""
    if options.seed is not None:
        return [options.seed]
    part, parts = (int(number) for number in options.shard.split("/"))
    count = math.ceil(runs / len(options.kind or KINDS))
    return list(range(options.first_seed, options.first_seed + count))[part - 1 :: parts]


def measure(options: argparse.Namespace) -> Found:
    """A campaign."""
    runs = options.runs or (DETECTOR_RUNS if options.off == "each" else RUNS)
    seeds, kinds = chosen(options, runs), options.kind or list(KINDS)
    one = partial(rows, kinds=kinds, profile=options.profile, off=options.off)
    if len(seeds) == 1:
        return one(seeds[0])
    with progress_bar("faults") as tell:
        return campaign(seeds, one, options.workers, tell)


def read(files: Iterable[Path]) -> Found:
    """Rows of several parts."""
    found = together(json.loads(file.read_text(encoding="utf-8")) for file in files)
    return {name: [tables.judge(row) for row in each] for name, each in found.items()}


def main() -> None:
    options = arguments()
    found = read(options.read) if options.read else measure(options)
    if options.json:
        options.json.write_text(json.dumps(found), encoding="utf-8")
    apart = {name.removeprefix("-"): each for name, each in found.items() if name.startswith("-")}
    whole = {name: each for name, each in found.items() if not name.startswith("-")}
    for name, each in whole.items():
        text = f"{tables.summary(each)} {tables.goals(options.profile)}\n\n{tables.table(each)}"
        print(f"{name or 'guarded'}: {text}\n")
        if options.write:
            insert(PAGE, f"faults {name or 'guarded'}", f"{made(options, name)}\n\n{text}")
    if apart:
        print(tables.off_table(apart))
        if options.write:
            insert(PAGE, "faults each", f"{made(options, 'each')}\n\n{tables.off_table(apart)}")
    if options.write:
        insert(PAGE, "kinds", tables.kinds_table())
    if options.kind and options.seed is not None:
        print(json.dumps(next(iter(found.values())), indent=1))


def made(options: argparse.Namespace, name: str) -> str:
    """When, and with what."""
    today = datetime.now(UTC).date().isoformat()
    of = {"": "All guards on", "unguarded": "No guards", "each": "One detector off in turn"}
    return f"{of.get(name, name + ' off')}, profile `{options.profile}`, {today}."


if __name__ == "__main__":
    main()
