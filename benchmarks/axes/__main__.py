"""Tracking of an operator's motion by loops of 1 to 8 degrees of freedom, and their computing time.

The plants are plays of this folder, independent of the package; the tip is measured as it is, 40
times per second, 50 ms late. `--write` updates docs/plants.md.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from axes import colonoscope, sensor_faults, start
from axes.tracking import PLANTS, Job, bound, simulate, times
from common.doc_pages import insert
from common.paths import ROOT
from common.processes import add_arguments, run_parallel
from common.rows import outcome_rows

FIRST_SEED, SEEDS = 400, 5
COUNTS = (1, 2, 5, 8)
GOAL = 0.85
"""Least reduction of the tracking error of a degree of freedom."""


def to_rows(found: dict[Job, list[float]]) -> list[dict[str, Any]]:
    """A row per number of degrees of freedom and plant: reductions over all and seeds, times."""
    rows = []
    for count in dict.fromkeys(count for count, _, _ in found):
        spent = times(count)
        for plant in PLANTS:
            own = [found[job] for job in found if job[:2] == (count, plant)]
            each = np.concatenate(own)
            exact = [one for job in found if job[:2] == (count, plant) for one in bound(job)]
            is_ideal = plant == "ideal"
            rows.append(
                {
                    "dofs": count,
                    "plant": plant,
                    "median": float(np.median(each)),
                    "worst": float(each.min()),
                    "share_below_goal": float(np.mean(each < GOAL)),
                    "bound": float(np.median(exact)) if is_ideal else None,
                    "bound_worst": min(exact) if is_ideal else None,
                    "tick": spent[0],
                    "update": spent[1],
                    "seeds": len(own),
                }
            )
    return rows


def colonoscope_table(found: dict[colonoscope.Job, list[float]]) -> str:
    """A Markdown table: a line per instrument."""
    lines = [
        "| instrument | bend_x | bend_y | insertion | with the preset | delay of 0.1 s found as |",
        "|--:|--:|--:|--:|--:|--:|",
    ]
    for seed in dict.fromkeys(seed for _, seed in found):
        less = " | ".join(f"{each:.0%}" for each in found["motion", seed])
        lines.append(f"| {seed} | {less} | {found['delay', seed][0]:.3f} s |")
    every = [found[job] for job in found if job[0] == "motion"]
    medians = " | ".join(f"{each:.0%}" for each in np.median(every, axis=0))
    lines.append(f"| median | {medians} | |")
    return "\n".join(lines)


def table(rows: Sequence[dict[str, Any]]) -> str:
    """A Markdown table: a line per number of degrees of freedom, both plants side by side."""
    lines = [
        "| degrees of freedom | ideal plays | below 85 % | bound | rounded plays "
        "| tick, update [us] |",
        "|--:|--:|--:|--:|--:|--:|",
    ]
    lines += [
        f"| {ideal['dofs']} | {ideal['median']:.0%}, {ideal['worst']:.0%} "
        f"| {ideal['share_below_goal']:.0%} | {ideal['bound']:.0%}, {ideal['bound_worst']:.0%} "
        f"| {rounded['median']:.0%}, {rounded['worst']:.0%} "
        f"| {1e6 * ideal['tick']:.0f}, {1e6 * ideal['update']:.0f} |"
        for ideal, rounded in zip(rows[::2], rows[1::2], strict=True)
    ]
    return "\n".join(lines)


def show(options: argparse.Namespace, found: Mapping[Any, Any], text: str) -> None:
    """Print the table, or the outcome of each job as one JSON object."""
    print(json.dumps({"outcomes": outcome_rows(found)}) if options.json else text)


def main() -> None:
    parser = argparse.ArgumentParser(prog="axes", description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=SEEDS, help="number of seeds [5]")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help=f"[{FIRST_SEED}]")
    parser.add_argument("--dofs", type=int, choices=COUNTS, help="only this number [all]")
    add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--write", action="store_true", help="update docs/plants.md")
    parser.add_argument(
        "--colonoscope", action="store_true", help="the simulated colonoscope in place of plays"
    )
    parser.add_argument("--start", action="store_true", help="the first 40 s of 60 drawn plays")
    parser.add_argument("--faults", action="store_true", help="of the sensor, with 40 seeds each")
    options = parser.parse_args()
    if options.write and options.dofs:
        parser.error("--write updates whole tables: use it without --dofs")
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    if options.colonoscope:
        both = [(what, seed) for seed in seeds for what in ("motion", "delay")]
        ran = dict(run_parallel(colonoscope.simulate, both, options.workers, options.scheduler))
        ran = {job: ran[job] for job in both}
        text = colonoscope_table(ran)
        if options.write:
            insert(ROOT / "docs" / "plants.md", "colonoscope", text)
        show(options, ran, text)
        return
    if options.start:
        drawn = range(options.first_seed, options.first_seed + start.DRAWS)
        wanted: list[start.Job] = [
            (what, zero, seed)
            for what in ("none", *start.PROFILES)
            for zero in start.ZEROS
            for seed in drawn
        ]
        spread = dict(run_parallel(start.simulate, wanted, options.workers, options.scheduler))
        spread = {job: spread[job] for job in wanted}
        text = start.table(spread)
        if options.write:
            head = f"Seeds {drawn[0]} to {drawn[-1]}; median, 10th percentile.\n\n"
            insert(ROOT / "docs" / "plants.md", "start", head + text)
        show(options, spread, text)
        return
    if options.faults:
        drawn = range(options.first_seed, options.first_seed + sensor_faults.SEEDS)
        faults = [
            sensor_faults.Job(kind, is_early, seed)
            for kind in sensor_faults.KINDS
            for is_early in (True, False)
            for seed in drawn
        ]
        moved = dict(
            run_parallel(sensor_faults.simulate, faults, options.workers, options.scheduler)
        )
        moved = {job: moved[job] for job in faults}
        text = sensor_faults.table(moved)
        if options.write:
            insert(ROOT / "docs" / "faults.md", "sensors", text)
        show(options, moved, text)
        return
    counts = [options.dofs] if options.dofs else COUNTS
    jobs = [(count, plant, seed) for count in counts for plant in PLANTS for seed in seeds]
    done = dict(run_parallel(simulate, jobs, options.workers, options.scheduler))
    rows = to_rows({job: done[job] for job in jobs})
    if options.write:
        head = f"Seeds {seeds[0]} to {seeds[-1]}; median and worst of all degrees of freedom.\n\n"
        insert(ROOT / "docs" / "plants.md", "axes", head + table(rows))
    print(json.dumps({"rows": rows}) if options.json else table(rows))


if __name__ == "__main__":
    main()
