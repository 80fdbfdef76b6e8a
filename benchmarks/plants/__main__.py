"""Tracking of an operator's motion by profile `best` on instruments other than the twin.

Each is independent of the package: plays per DOF with another gain, shape or change over time. The
feedback is features with noise, 80 ms late. `--write` updates docs/plants.md.
"""

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
from plants.simulated import GAIN, PLANTS
from plants.tracking import Job, Outcome, simulate
from tautscope.dof import Dof

FIRST_SEED, SEEDS = 300, 5
GOAL, WORST_GOAL = 0.84, 0.65
"""Least reduction of the tracking error: median and worst seed."""
ESTIMATE_GOAL = 0.1
"""Largest error of the estimated gains, and of the share of the friction in common, which is 0."""


def to_rows(found: dict[Job, Outcome]) -> list[dict[str, Any]]:
    """Rows of each plant: reductions per DOF, median and worst seed, errors of gains and share."""
    rows = []
    for plant in dict.fromkeys(plant for plant, _ in found):
        runs = [each for (name, _), each in found.items() if name == plant]
        gain = GAIN if plant == "gain 0.8" else 1.0
        for dof in Dof:
            values = [run.reductions[dof] for run in runs]
            errors = [abs(run.gains[dof] - gain) for run in runs]
            for what, shown, goal, sense in (
                (plant, values, GOAL, "min"),
                (f"{plant}, worst seed", [min(values)], WORST_GOAL, "min"),
                (f"{plant}, gain", errors, ESTIMATE_GOAL, "max"),
            ):
                unit = "1" if sense == "max" else "share"
                row = goal_row(
                    what, unit, shown, goal, sense, dof=dof.label, profile="best", n=len(runs)
                )
                rows.append({**row, "plant": plant})
        shares = [abs(run.shared) for run in runs]
        row = goal_row(f"{plant}, share", "1", shares, ESTIMATE_GOAL, profile="best", n=len(runs))
        rows.append({**row, "plant": plant})
    return rows


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return a Markdown table: a line per plant, median (worst), reductions in percent."""
    lines = [
        "| instrument | insertion | rotation | bending | gain off by | share off by "
        "| goals missed |",
        "|---|--:|--:|--:|--:|--:|---|",
    ]
    for plant in dict.fromkeys(row["plant"] for row in rows):
        own = {
            (row["what"].removeprefix(plant), row["dof"]): row
            for row in rows
            if row["plant"] == plant
        }
        reductions = [
            f"{100 * own['', dof.label]['median']:.0f} ({100 * own['', dof.label]['worst']:.0f})"
            for dof in Dof
        ]
        gains = [own[", gain", dof.label] for dof in Dof]
        share = own[", share", None]
        gain = (max(row[key] for row in gains) for key in ("median", "worst"))
        estimates = [
            "{:.2f} ({:.2f})".format(*gain),
            f"{share['median']:.2f} ({share['worst']:.2f})",
        ]
        missed = dict.fromkeys(
            (row["dof"] or "") + what.removesuffix("worst seed").rstrip(", ").replace(",", "")
            for (what, _), row in own.items()
            if not row["holds"]
        )
        cells = [plant, *reductions, *estimates, ", ".join(each.strip() for each in missed)]
        lines.append(f"| {' | '.join(cells)} |")
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
    done = dict(run_parallel(simulate, jobs, options.workers, options.scheduler))
    rows = to_rows({job: done[job] for job in jobs})
    shown = table(rows)
    print(json.dumps({"rows": rows, "seeds": list(seeds)}) if options.json else shown)
    if options.write:
        text = f"Seeds {seeds[0]} to {seeds[-1]}; median (worst) in percent.\n\n{shown}"
        insert(ROOT / "docs" / "plants.md", "plants", text)


if __name__ == "__main__":
    main()
