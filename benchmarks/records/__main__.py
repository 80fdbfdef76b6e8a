"""Prediction of the tip on records, by the weighted mixture and all other models of `analyze`.

Records of real tools (TAUTSCOPE_DATA), and synthetic families. `--write` updates docs/models.md.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from common.doc_pages import insert
from common.paths import ROOT
from common.processes import add_arguments, run_parallel
from common.rows import goal_row
from records.evaluation import Job, Result, evaluate
from records.families import FAMILIES
from records.tools import SPLICED, tools
from tautscope.analysis.comparison import HORIZONS

FIRST_SEED, SEEDS = 100, 5
"""The settings of the mixture were chosen on seeds 0 to 5."""
GOAL, STROKES_GOAL, WORSE_GOAL = 1.05, 2, 2
"""Largest ratio to the best other model, strokes to follow a change, and strokes worse than the
trivial predictors."""

Results = dict[str, list[list[Result]]]
"""By name: per seed, per horizon."""


def to_rows(results: Results) -> list[dict[str, Any]]:
    """Rows per record or family and horizon."""
    return [row for name, found in results.items() for row in _rows(name, found)]


def _rows(name: str, found: list[list[Result]]) -> Iterator[dict[str, Any]]:
    for at, share in enumerate(HORIZONS):
        each = [result[at] for result in found]
        quantities: list[tuple[str, str, list[float], float]] = [
            ("best", "ratio to the best other model", [r.ratio for r in each], GOAL),
            ("best", "ratio to the best other predictor", [r.predicting for r in each], GOAL),
            ("best", "strokes worse than trivial", [r.worse_strokes for r in each], WORSE_GOAL),
        ]
        if name in SPLICED:
            for what, values in (
                ("strokes to follow", [r.strokes_to_follow or 0 for r in each]),
                ("strokes to settle", [r.strokes_to_settle or 0 for r in each]),
            ):
                quantities.append(("best", what, [float(v) for v in values], STROKES_GOAL))
        for profile, what, values, goal in quantities:
            row = goal_row(f"{name}, {share:.0%}: {what}", "1", values, goal, profile=profile)
            yield row | {"record": name, "horizon": share, "quantity": what}


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Markdown: ratios per record or family, then what follows the splices."""
    names = dict.fromkeys(row["record"] for row in rows)

    def cells(name: str, quantity: str) -> list[str]:
        own = [row for row in rows if row["record"] == name and row["quantity"] == quantity]
        return [
            f"{row['median']:.2f}" + (f" ({row['worst']:.2f})" if row["n"] > 1 else "")
            for row in own
        ]

    def worst(name: str, quantity: str) -> list[str]:
        own = [row for row in rows if row["record"] == name and row["quantity"] == quantity]
        return [f"{row['worst']:.0f}" for row in own]

    shares = " | ".join(f"{100 * share:.0f} %" for share in HORIZONS)
    lines = [
        f"| record or family | {shares} | {shares} | {shares} |",
        f"|---|{'--:|' * 3 * len(HORIZONS)}",
    ]
    for name in names:
        ratios = cells(name, "ratio to the best other model")
        predicting = cells(name, "ratio to the best other predictor")
        behind = worst(name, "strokes worse than trivial")
        lines.append(f"| {name} | {' | '.join([*ratios, *predicting, *behind])} |")
    spliced = [name for name in names if name in SPLICED]
    if spliced:
        lines += ["", f"| spliced | {shares} | {shares} |", f"|---|{'--:|' * 2 * len(HORIZONS)}"]
        for name in spliced:
            counts = [*worst(name, "strokes to follow"), *worst(name, "strokes to settle")]
            lines.append(f"| {name} | {' | '.join(counts)} |")
    missed = [row for row in rows if row["quantity"] == "ratio to the best other model"]
    for share in HORIZONS:
        own = [row for row in missed if row["horizon"] == share]
        held = sum(row["holds"] for row in own)
        ratios = [row["median"] for row in own]
        lines += [
            "",
            f"At {100 * share:.0f} %: {held} of {len(own)} records and families hold {GOAL}; "
            f"median {np.median(ratios):.2f}, worst {max(ratios):.2f}, worst seed "
            f"{max(row['worst'] for row in own):.2f}.",
        ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=SEEDS, help="per family [%(default)s]")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help="[%(default)s]")
    parser.add_argument("--only", choices=["tools", "families"], help="[both]")
    add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--write", action="store_true", help="update docs/models.md")
    options = parser.parse_args()
    if options.write and (options.only or not tools()):
        parser.error("--write updates the whole table: use it without --only, with TAUTSCOPE_DATA")
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    jobs: list[Job] = []
    if options.only != "families":
        if not tools():
            print("No records of tools: TAUTSCOPE_DATA has no davinci_tools.", file=sys.stderr)
        else:
            jobs += [(name, 0) for name in [*tools(), *SPLICED]]
    if options.only != "tools":
        jobs += [(family, seed) for family in FAMILIES for seed in seeds]
    done = dict(run_parallel(evaluate, jobs, options.workers, options.scheduler))
    results: Results = {}
    for job in jobs:
        results.setdefault(job[0], []).append(done[job])
    rows = to_rows(results)
    shown = table(rows)
    print(json.dumps({"rows": rows, "seeds": list(seeds)}) if options.json else shown)
    if options.write:
        text = f"Families: seeds {seeds[0]} to {seeds[-1]}, median (worst).\n\n{shown}"
        insert(ROOT / "docs" / "models.md", "records", text)


if __name__ == "__main__":
    main()
