"""Tracking of an operator's motion by profile `best` on instruments other than the twin.

Each is independent of the package: plays per DOF with another gain, shape or change over time. The
feedback is features with noise, 80 ms late. `--write` updates docs/plants.md.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from common.doc_pages import insert
from common.paths import ROOT
from common.processes import add_arguments, run_parallel
from common.rows import goal_row
from plants.simulated import PLANTS
from plants.tracking import Job, reductions
from tautscope.dof import Dof

FIRST_SEED, SEEDS = 300, 5
GOAL, WORST_GOAL = 0.80, 0.65
"""Least reduction of the tracking error: median and worst seed."""


def to_rows(found: dict[Job, list[float]]) -> list[dict[str, Any]]:
    """Two rows per plant and DOF: the median with its goal, and the worst seed with its own."""
    rows = []
    for plant in dict.fromkeys(plant for plant, _ in found):
        for dof in Dof:
            values = [each[dof] for (name, _), each in found.items() if name == plant]
            for what, shown, goal in (
                (plant, values, GOAL),
                (f"{plant}, worst seed", [min(values)], WORST_GOAL),
            ):
                row = goal_row(
                    what, "share", shown, goal, "min", dof=dof.label, profile="best", n=len(values)
                )
                rows.append(row)
    return rows


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return a Markdown table: a line per plant, median (worst) in percent."""
    lines = [
        "| instrument | insertion | rotation | bending | goals missed |",
        "|---|--:|--:|--:|---|",
    ]
    for plant in dict.fromkeys(row["what"].removesuffix(", worst seed") for row in rows):
        cells, missed = [], []
        for dof in Dof:
            middle, worst = (
                row
                for row in rows
                if row["dof"] == dof.label and row["what"].removesuffix(", worst seed") == plant
            )
            cells.append(f"{100 * middle['median']:.0f} ({100 * worst['median']:.0f})")
            missed += [] if middle["holds"] and worst["holds"] else [dof.label]
        lines.append(f"| {plant} | {' | '.join(cells)} | {', '.join(missed)} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=SEEDS, help="number of seeds [%(default)s]")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help="[%(default)s]")
    parser.add_argument("--plant", choices=PLANTS, action="append", help="only this one [all]")
    add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--write", action="store_true", help="update docs/plants.md")
    options = parser.parse_args()
    if options.write and options.plant:
        parser.error("--write updates the whole table: use it without --plant")
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    jobs = [(plant, seed) for plant in options.plant or PLANTS for seed in seeds]
    done = dict(run_parallel(reductions, jobs, options.workers, options.scheduler))
    rows = to_rows({job: done[job] for job in jobs})
    shown = table(rows)
    print(json.dumps({"rows": rows, "seeds": list(seeds)}) if options.json else shown)
    if options.write:
        text = f"Seeds {seeds[0]} to {seeds[-1]}; median (worst) in percent.\n\n{shown}"
        insert(ROOT / "docs" / "plants.md", "plants", text)


if __name__ == "__main__":
    main()
