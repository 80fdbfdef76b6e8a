"""The command ``tautscope calibrate all``."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.calibration.result import CalibrationResult
from tautscope.commands import arguments, calibration_rig
from tautscope.commands.calibrate_camera import add_board_options
from tautscope.commands.calibration_session import CalibrationSession
from tautscope.commands.printing import print_json
from tautscope.commands.question import ask
from tautscope.config import Config
from tautscope.errors import TautscopeError, described
from tautscope.runs.output_folder import check_free, default_folder

if TYPE_CHECKING:
    from tautscope.commands.calibration_steps import Step

_NAMES = ("camera", "colour", "geometry", "latency", "doctor", "motion")
_INCOMPLETE = 1


def add_parser(kinds: arguments.Verbs) -> None:
    """Add the command to the parser of ``tautscope calibrate``."""
    every = arguments.add_verb(
        kinds,
        "all",
        _run,
        help="all calibrations in turn, then a check and a first compensated motion",
        description="Calibrate the camera, the colour of the bands and the geometry, check the rig "
        "as doctor, and run a first compensated motion. Each result is written into the "
        "configuration at once; an interrupted sequence is resumed by the same command. THE MOTORS "
        "MOVE, after a question. Writes a folder with a report.",
        extras=["hardware"],
    )
    arguments.add_config(every, required=True)
    add_board_options(every)
    calibration_rig.add_options(every)
    every.add_argument(
        "--skip", action="append", choices=_NAMES, default=[], help="leave out a step; repeatable"
    )
    every.add_argument(
        "--restart", action="store_true", help="begin anew instead of resuming the last sequence"
    )
    arguments.add_out(every, "calibrate")
    arguments.add_json(every)


def _run(options: argparse.Namespace) -> int:
    from tautscope.commands.calibration_steps import STEPS  # noqa: PLC0415

    calibration_rig.check_options(options)
    if options.twin:
        arguments.refuse_unused(options, "the live camera, whose time limit it is", "seconds")
    config = arguments.article_config(options.config)
    seed = options.seed = calibration_rig.twin_seed(options, config) if options.twin else None
    if not options.twin:
        calibration_rig.refuse_wrong_limits(options.config)
    folder = options.out or default_folder("calibrate")
    session = CalibrationSession(Path(options.config), folder, seed, restart=options.restart)
    if not session.state.done:
        check_free(session.folder)
    else:
        if folder.absolute() != session.folder:
            resumed = f"{session.folder}, that of the sequence that is resumed; or --restart"
            arguments.refuse_unused(options, resumed, "out")
        _say(f"Resumed; done: {', '.join(session.state.done)}. Folder: {session.folder}")
    for number, step in enumerate(STEPS, 1):
        if step.name in session.state.done:
            continue
        _say(f"\nStep {number} of {len(STEPS)}: {step.title}. {step.todo}")
        if not _do(step, session, options):
            _say(f"Stopped. To resume: tautscope calibrate all --config {options.config}")
            return _INCOMPLETE
    report = session.finish({step.name: step.title for step in STEPS})
    print_json(options, {"folder": str(session.folder), "done": session.state.done})
    print(f"Calibrated: {options.config}. Report: {report}")
    return 0


def _do(step: Step, session: CalibrationSession, options: argparse.Namespace) -> bool:
    """Do or skip a step; False if the user stops."""
    result: CalibrationResult | None = None
    while result is None:
        answer = "s" if step.name in options.skip else _answer(options, session.config)
        if answer == "q":
            return False
        if answer == "s":
            break
        # The answer was the question whether the motors may move.
        changes = {"yes": True, "drawn": session.state.drawn}
        confirmed = argparse.Namespace(**vars(options) | changes)
        try:
            result = step.run(confirmed, session.config, session.folder)
        except TautscopeError as error:
            if options.yes or options.twin:
                raise
            _say(f"error: {described(error)}")
    session.finish_step(step.name, result)
    for note in result.notes if result is not None else ("skipped",):
        _say(f"  {note}")
    return True


def _answer(options: argparse.Namespace, config: Config) -> str:
    """``y`` to do the step, ``s`` to skip it, ``q`` to stop."""
    if options.yes or options.twin:
        return "y"
    while True:
        line = ask("Type y to start, s to skip, q to stop: ", config.camera)
        answer = line.strip()[:1] if line else "q"
        if answer in ("y", "s", "q"):
            return answer


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
