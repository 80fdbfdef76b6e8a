"""The command ``tautscope run``."""

import argparse
import sys

from tautscope.commands import arguments, robot
from tautscope.commands.calibration_rig import add_yes, confirm_motion
from tautscope.commands.positions import add_reference, read_reference
from tautscope.commands.printing import announce, print_json, progress_bar
from tautscope.commands.result_lines import print_results
from tautscope.commands.rig_choice import add_rig, choose_rig
from tautscope.commands.run_protocol import add_protocol, apply_protocol, write_environment
from tautscope.config.placeholders import refuse_placeholders
from tautscope.errors import FieldError, may_move, notes
from tautscope.hardware.doctor.computer import bytes_per_second
from tautscope.loop.references import SineSequence
from tautscope.runs.output_folder import recording_saved


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
    add_protocol(run)
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

    apply_protocol(options)
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
        write_environment(options, config, folder)
    print_json(options, {"folder": str(folder), **found.to_json()})
    timing = found.compensated.timing.summary()
    print(
        f"{timing['cycles']} cycles, {timing['lost_cycles']} lost; set-points at most "
        f"{timing['jitter_ms']['worst']:.2g} ms late; {timing['frames']} frames, age "
        f"{timing['frame_age_ms']['median']:.3g} ms (median)."
    )
    print_results(found.recorded, folder)
    return 0
