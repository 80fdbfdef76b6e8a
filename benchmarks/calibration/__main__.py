"""Calibration of the geometry on simulated rigs that differ from their configuration.

N twins whose loop is told wrong (pose to 5 deg and 5 mm, section 10 %, bands 1 mm, focal length
3 %, delay to 200 ms), on features with 0.5 px of noise or on images; other instruments; the loop
with the result; records that the model cannot explain.
"""

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from calibration.evaluation import Job, Outcome, evaluate
from calibration.records import INSTRUMENTS, Case
from calibration.tables import alarm_table, error_table, loop_table
from common.doc_pages import find, insert
from common.paths import ROOT
from common.processes import Results, add_arguments, run_until_stopped

PAGE = ROOT / "docs" / "calibration.md"


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--twins", type=int, default=50, help="[%(default)s]")
    parser.add_argument("--first-seed", type=int, default=0, help="[%(default)s]")
    parser.add_argument("--images", action="store_true", help="find the bands in images")
    parser.add_argument("--band-distance", action="store_true", help="with a measured distance")
    parser.add_argument("--instrument", choices=INSTRUMENTS, default="nominal")
    parser.add_argument(
        "--loop", type=int, default=0, metavar="N", help="twins whose loop is run with the result"
    )
    parser.add_argument(
        "--alarms", type=int, default=0, metavar="N", help="twins with contradictory records too"
    )
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--write", metavar="NAME", help=f"update this part of {PAGE.name}")
    add_arguments(parser)
    options = parser.parse_args()
    if options.write:
        if options.images or options.band_distance or options.instrument != "nominal":
            parser.error(
                "--write updates the table of nominal twins with features: use it without "
                "--images, --band-distance and --instrument"
            )
        try:
            find(PAGE, options.write)
        except ValueError as error:
            parser.error(f"--write {options.write}: {error}")
    return options


def measure(options: argparse.Namespace) -> Results[Job, Outcome]:
    """Calibrate every twin; Ctrl-C ends with those that are finished."""
    seeds = range(options.first_seed, options.first_seed + options.twins)
    jobs = [
        Job(
            Case(seed, options.instrument, options.images),
            options.band_distance,
            index < options.loop,
            index < options.alarms,
        )
        for index, seed in enumerate(seeds)
    ]
    return run_until_stopped(evaluate, jobs, options, "calibrations")


def report(options: argparse.Namespace, found: dict[int, Outcome]) -> str:
    """The tables with their conditions, as Markdown."""
    outcomes = list(found.values())
    source = "images" if options.images else "features"
    scale = ", measured band distance" if options.band_distance else ""
    title = f"{options.instrument}, seeds {min(found)} to {max(found)}, {source}{scale}"
    parts = [error_table(title, outcomes)]
    if options.loop:
        parts.append(loop_table([each for each in outcomes if each.hand]))
    if options.alarms:
        parts.append(alarm_table([each for each in outcomes if each.alarms]))
    return "\n\n".join(parts)


def main() -> None:
    options = arguments()
    done = measure(options)
    found = {job.case.seed: outcome for job, outcome in done.items()}
    text = report(options, found)
    if options.json:
        print(json.dumps({seed: asdict(outcome) for seed, outcome in found.items()}))
    else:
        for seed, outcome in found.items():
            shown = {name: round(value, 2) for name, value in outcome.errors.items()}
            print(seed, "" if outcome.is_plausible else "NOT PLAUSIBLE", shown, *outcome.warnings)
        print(text)
    done.require_all()
    if options.write:
        insert(PAGE, options.write, text)


if __name__ == "__main__":
    main()
