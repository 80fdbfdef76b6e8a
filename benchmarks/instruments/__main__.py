"""Reduction of the tracking error on drawn instruments, about which the loop is told wrongly.

`best`, `paper` and no compensation on N instruments; ranges of the draw in
`instruments.properties`. `--seed S` repeats one instrument.
"""

import argparse
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from common.doc_pages import insert
from common.paths import ROOT
from common.processes import add_arguments, run_until_stopped
from instruments.alarms import alarm_table
from instruments.explanation import explain
from instruments.properties import markdown_table
from instruments.rows import Row, seed_rows, seed_table, summary_rows, table
from instruments.runs import VARIANTS, Run, simulate
from tautscope.report.operator_motion import EVALUATED_AFTER

MOTIONS = ("hand", "sines")
INSTRUMENTS = 200
PAGE = ROOT / "docs" / "instruments.md"
ALARMS = ROOT / "docs" / "faults.md"


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--instruments", type=int, default=INSTRUMENTS, help="[%(default)s]")
    parser.add_argument("--first-seed", type=int, default=0, help="[%(default)s]")
    parser.add_argument("--seed", type=int, help="only the instrument of this seed")
    feedback = parser.add_mutually_exclusive_group()
    feedback.add_argument("--images", action="store_true", help="camera images [default]")
    feedback.add_argument(
        "--features", action="store_true", help="true features with noise in place of images: fast"
    )
    parser.add_argument(
        "--motion", choices=MOTIONS, action="append", help="only this motion [both]"
    )
    parser.add_argument(
        "--variant", choices=VARIANTS, action="append", help="only this one, and none [all]"
    )
    parser.add_argument(
        "--duration", type=float, default=120.0, help="of motion hand [%(default)s s]"
    )
    add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--write", action="store_true", help=f"update {PAGE.relative_to(ROOT)}")
    options = parser.parse_args()
    if options.duration <= EVALUATED_AFTER:
        parser.error(f"--duration {options.duration:g}: must be above {EVALUATED_AFTER:g} s")
    is_whole = "hand" in (options.motion or MOTIONS) and not (options.features and options.variant)
    if options.write and (options.seed is not None or not is_whole):
        parser.error(
            "--write updates whole tables: use it without --seed, not with --motion sines alone, "
            "and with --features without --variant"
        )
    return options


def plan(options: argparse.Namespace) -> list[Run]:
    """Return all runs, the longest first."""
    seeds = range(options.first_seed, options.first_seed + options.instruments)
    runs = [
        Run(seed, motion, variant, not options.features, options.duration)
        for seed in (seeds if options.seed is None else [options.seed])
        for motion in options.motion or MOTIONS
        for variant in VARIANTS
        if variant in ("none", *(options.variant or VARIANTS))
    ]
    return sorted(runs, key=lambda run: run.variant == "none")


def results(options: argparse.Namespace, rows: list[Row]) -> str:
    """Return the tables of all motions with their conditions, as Markdown."""
    seeds = [row["seed"] for row in rows]
    source = "true features with noise" if options.features else "camera images"
    parts = []
    for motion in options.motion or MOTIONS:
        parts += [f"Motion `{motion}`, seeds {min(seeds)} to {max(seeds)}, {source}."]
        parts += [table(rows, motion), f"```text\n{explain(rows, motion)}\n```"]
    return "\n\n".join(parts)


def main() -> None:
    options = arguments()
    found = run_until_stopped(simulate, plan(options), options, "instruments")
    rows = seed_rows(found)
    if not rows:
        raise SystemExit("No instrument is finished.")
    text = results(options, rows)
    if options.json:
        facts = {"images": not options.features, "instruments": rows}
        print(json.dumps({"rows": summary_rows(rows), **facts}))
    else:
        print(f"{seed_table(rows)}\n\n{text}\n\n{alarm_table(rows)}")
    found.require_all()
    if options.write:
        if options.features and (alarms := alarm_table(rows)):
            insert(ALARMS, "alarms", alarms)
        insert(PAGE, "ranges", markdown_table())
        insert(PAGE, "features" if options.features else "images", text)


if __name__ == "__main__":
    main()
