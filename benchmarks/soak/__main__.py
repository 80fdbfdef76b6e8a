"""Tracking error over two hours of strokes shorter and longer than the slack, and of rests.

On ideal plays, on the twin, and on the twin with faults of the images. Every tenth of a
run is judged by itself. `--write` updates the tables of these plants in docs/soak.md.
"""

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from common.doc_pages import insert
from common.paths import ROOT
from common.processes import Results, add_arguments, run_until_stopped
from soak.cases import PLANTS, Case, Outcome, simulate
from soak.references import MOTIONS
from soak.rows import table, to_rows

STROKES = (0.3, 0.6, 1.0, 2.0)
"""Over the width of the slack."""
STROKES_WITH_RESTS = (1.0,)
SECONDS = 7200.0
FIRST_SEED, SEEDS = 700, 1
PAGE = ROOT / "docs" / "soak.md"


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=SECONDS, help="of a run [%(default)s]")
    parser.add_argument(
        "--stroke", type=float, action="append", help="only this one, over the slack's width [all]"
    )
    parser.add_argument("--motion", choices=MOTIONS, action="append", help="only this one [all]")
    parser.add_argument("--plant", choices=PLANTS, action="append", help="only this one [all]")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="number of seeds [%(default)s]")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help="[%(default)s]")
    add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--write", action="store_true", help=f"update {PAGE.relative_to(ROOT)}")
    options = parser.parse_args()
    if options.write and (options.stroke or options.motion):
        parser.error(
            "--write updates whole tables: use it without a selection of strokes or motions"
        )
    return options


def measure(options: argparse.Namespace) -> Results[Case, Outcome]:
    """Simulate; Ctrl-C ends with the runs that are finished."""
    cases = [
        Case(plant, motion, stroke, seed, options.seconds)
        for plant in options.plant or PLANTS
        for motion in options.motion or MOTIONS
        for stroke in options.stroke or (STROKES_WITH_RESTS if motion == "rests" else STROKES)
        for seed in range(options.first_seed, options.first_seed + options.seeds)
    ]
    return run_until_stopped(simulate, cases, options, "soak")


def main() -> None:
    options = arguments()
    found = measure(options)
    shown = table(found)
    if options.json:
        cases = [asdict(case) | asdict(outcome) for case, outcome in found.items()]
        print(json.dumps({"rows": to_rows(found), "cases": cases}))
    else:
        print(shown)
    found.require_all()
    if options.write:
        last = options.first_seed + options.seeds - 1
        seeds = f"{options.first_seed}" if options.seeds == 1 else f"{options.first_seed} to {last}"
        for plant in dict.fromkeys(case.plant for case in found):
            shown = table({case: each for case, each in found.items() if case.plant == plant})
            text = f"Seed {seeds}, {options.seconds:g} s; errors are RMS, per DOF.\n\n{shown}"
            insert(PAGE, f"soak {plant}", text)


if __name__ == "__main__":
    main()
