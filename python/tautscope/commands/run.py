"""The command ``tautscope run``: the article's experiment, or that of the desktop rig."""

import argparse
import datetime
import json
import sys
from pathlib import Path

from tautscope.commands import arguments, robot
from tautscope.commands.calibration_rig import add_yes, confirm_motion
from tautscope.commands.positions import add_reference, read_reference
from tautscope.commands.printing import announce, print_json, progress_bar
from tautscope.commands.result_lines import print_results
from tautscope.commands.rig_choice import add_rig, choose_rig
from tautscope.config import Config
from tautscope.config.placeholders import refuse_placeholders
from tautscope.errors import FieldError, may_move, notes
from tautscope.hardware.doctor.computer import bytes_per_second, check_computer
from tautscope.log.header import software_versions
from tautscope.loop.references import SineSequence
from tautscope.runs.output_folder import recording_saved

BENDS = (0, 90, 180, 360)
"""Bends of the desktop rig's channel [degrees]."""
DESKTOP_PERIODS = 3
"""Periods per DOF of protocol ``desktop``: the fewest that the experiment may have."""
_ABOUT = """A record of the desktop rig of tautscope, made by `tautscope run --protocol desktop`.

report.html             tables and figures; open it in a browser
compensated.mcap        log of the run with compensation: images, references, motors, estimates
uncompensated.mcap      log of the same motion without it, which was recorded first
config.toml             the configuration, every key
environment.json        bend of the channel, software, computer
*.csv                   tables of both runs; recording*.toml describe them

Before you share this folder look through environment.json and run.json: they name your computer's
system and folders. docs/records.md of tautscope says where records go, and under which licence.
"""


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    run = arguments.add_verb(
        verbs,
        "run",
        _run,
        help="run the article's experiment, or a recorded motion, on the drives and camera of a "
        "configuration",
        description="Run the article's experiment on the drives and the camera of a configuration, "
        "or a recorded motion of an operator. "
        "THE MOTORS MOVE. Writes a folder with the log, tables, a timing figure and a report. On "
        "every exit the motors are quick-stopped. Research software, not a medical device; have an "
        "emergency stop within reach.",
        extras=["hardware"],
    )
    arguments.add_config(run, required=True)
    arguments.add_profile(run, "how slack is compensated")
    run.add_argument(
        "--compare",
        action="store_true",
        help="run without compensation first, and print Table 1 from the state estimates",
    )
    run.add_argument(
        "--periods",
        type=arguments.positive,
        metavar="N",
        help="periods of the reference per DOF [experiment.periods of the configuration]",
    )
    run.add_argument(
        "--protocol",
        choices=("article", "desktop"),
        default="article",
        help="desktop: three periods per DOF without, then with compensation, and a folder to "
        "share, see docs/records.md [%(default)s]",
    )
    run.add_argument(
        "--bend",
        type=int,
        choices=BENDS,
        help="of --protocol desktop: bend of the channel [degrees]",
    )
    add_reference(run, "the article's experiment")
    add_rig(
        run,
        "run an operator's motion, without and then with compensation, on a rig of your own in "
        "place of [drives] and [camera]",
    )
    robot.add_seconds(run, "a rig")
    add_yes(run)
    arguments.add_out(run, "run")
    arguments.add_json(run)


def _run(options: argparse.Namespace) -> int:
    from tautscope.hardware.experiment import run_on_hardware  # noqa: PLC0415
    from tautscope.hardware.run_results import write_run_folder  # noqa: PLC0415

    _apply_protocol(options)
    if options.rig is not None:
        if options.reference is not None or options.periods is not None or options.compare:
            what = "neither --reference nor --periods nor --compare"
            raise FieldError("--rig", options.rig, what)
        config, make = choose_rig(options)
        refuse_placeholders(options.config)
        robot.run(options, config, options.rig, make, seed=0)
        return 0
    if options.seconds is not None:
        raise FieldError("--seconds", options.seconds, "--rig")
    config = arguments.article_config(options.config, options.profile)
    refuse_placeholders(options.config)
    if options.periods is not None:
        if options.reference is not None:
            raise FieldError("--periods", options.periods, "no --reference, which has no periods")
        config = config.replace(**{"experiment.periods": options.periods})
    reference = read_reference(options, config) or SineSequence(config.experiment)
    folder = arguments.out_folder(options)
    runs = 2 if options.compare else 1
    seconds = runs * reference.duration
    announce(f"{runs} run{'s' * (runs > 1)}", seconds, seconds * bytes_per_second(config), folder)
    confirm_motion(options, "as the reference does. Keep", config)
    try:
        with recording_saved(folder), progress_bar("run") as progress:
            found = run_on_hardware(config, folder, progress, reference, compare=options.compare)
    except KeyboardInterrupt as stop:
        what = "Interrupted." + " The motors are stopped." * (not may_move(stop))
        print("\n".join([what, *notes(stop)]), file=sys.stderr)
        return 130
    write_run_folder(found, folder)
    if options.protocol == "desktop":
        _write_environment(options, config, folder)
    print_json(options, {"folder": str(folder), **found.to_json()})
    timing = found.compensated.timing.summary()
    print(
        f"{timing['cycles']} cycles, {timing['lost_cycles']} lost; set-points at most "
        f"{timing['jitter_ms']['worst']:.2g} ms late; {timing['frames']} frames, age "
        f"{timing['frame_age_ms']['median']:.3g} ms (median)."
    )
    print_results(found.recorded, folder)
    return 0


def _apply_protocol(options: argparse.Namespace) -> None:
    """Set what the protocol determines: both runs, and three periods."""
    if options.protocol != "desktop":
        if options.bend is not None:
            raise FieldError("--bend", options.bend, "--protocol desktop, of whose rig it is")
        return
    for name in ("reference", "rig"):
        if getattr(options, name) is not None:
            allowed = f"no --{name}, which is another motion or rig"
            raise FieldError("--protocol", "desktop", allowed)
    if options.bend is None:
        allowed = f"--bend with the bend of the channel in degrees: {', '.join(map(str, BENDS))}"
        raise FieldError("--protocol", "desktop", allowed)
    options.compare = True
    options.periods = options.periods or DESKTOP_PERIODS


def _write_environment(options: argparse.Namespace, config: Config, folder: Path) -> None:
    """Write what a shared record needs beside log and report."""
    facts = {
        "protocol": options.protocol,
        "bend": options.bend,
        "recorded": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "software": software_versions(),
        "computer": {check.what: check.found for check in check_computer(config)},
    }
    text = json.dumps(facts, indent=1) + "\n"
    (folder / "environment.json").write_text(text, encoding="utf-8")
    (folder / "README.txt").write_text(_ABOUT, encoding="utf-8")
