"""``tautscope demo``."""

import argparse
import os
from pathlib import Path

from tautscope.commands import arguments, robot
from tautscope.commands.printing import announce, print_json, progress_bar
from tautscope.commands.rig_choice import add_robot, choose_rig
from tautscope.config import DISTURBANCES, Config
from tautscope.errors import MissingPathError
from tautscope.loop.references import SineSequence
from tautscope.runs.output_folder import recording_saved

SPEED = 12.0
"""Simulated seconds per second and processor, measured on two shared cores in 2026."""
START_TIME = 15.0
"""Time for the start of the processes, for figures and for the film [s]."""
BYTES_PER_SECOND = 80e3
"""Size of the run folder per simulated second of the first seed [byte/s]."""


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the verb ``demo``."""
    demo = arguments.add_verb(
        verbs,
        "demo",
        _run,
        help="run the article's experiment on the simulated instrument",
        description="Run the article's experiment and an operator motion on the simulated "
        "instrument, each with and without compensation, with camera images as the only feedback. "
        "Prints Table 1 with the article's values and the tracking error of the operator motion, "
        "and writes a run folder with tables, traces, figures and a report.",
        extras=["twin"],
    )
    arguments.add_profile(
        demo, "compensation scheme: the article's alone (paper), or also our own (best)"
    )
    demo.add_argument(
        "--seed",
        type=arguments.natural,
        metavar="N",
        help="seed of the instrument, or of the first one [twin.seed of the configuration]",
    )
    demo.add_argument(
        "--seeds",
        type=arguments.positive,
        default=1,
        metavar="N",
        help="number of instruments, with seeds N, N+1, ...; tables are of all [%(default)s]",
    )
    demo.add_argument(
        "--background", metavar="DIR", help="folder of images to use as tissue [procedural mucosa]"
    )
    demo.add_argument(
        "--disturb",
        metavar="NAME[,NAME]",
        help=f"image disturbances: {', '.join(DISTURBANCES)} [twin.disturb of the configuration]",
    )
    add_robot(
        demo,
        "another simulated robot in place of the article's instrument: the steerable tip of a "
        "colonoscope with an EM tracker; an operator's motion without and with compensation",
    )
    robot.add_seconds(demo, "--robot")
    arguments.add_out(demo, "demo")
    arguments.add_config(demo)
    arguments.add_json(demo)


def _run(options: argparse.Namespace) -> None:
    from tautscope.report import demo  # noqa: PLC0415

    if options.robot is not None:
        _run_robot(options)
        return
    arguments.refuse_unused(options, "--robot", "seconds")
    config = _load(options)
    folder = arguments.out_folder(options)
    first = config.twin.seed
    seeds = range(first, first + options.seeds)
    trials = demo.demo_trials(config)
    runs = len(seeds) * len(trials)
    motions = (each.motion or SineSequence(each.config.experiment) for each in trials)
    seconds = sum(motion.duration for motion in motions)
    processors = min(os.cpu_count() or 1, runs)
    announce(
        f"{runs} runs with {'seeds' if len(seeds) > 1 else 'seed'} {', '.join(map(str, seeds))}",
        len(seeds) * seconds / SPEED / processors + START_TIME,
        seconds * BYTES_PER_SECOND,
        folder,
    )
    with recording_saved(folder), progress_bar(f"{runs} runs") as progress:
        found = demo.run_demo(config, seeds, progress)
    demo.write_run_folder(found, folder)
    print_json(options, {"folder": str(folder), **found.to_json()})
    dofs = ", ".join(dof.label for dof in found.results[0])
    several = f", medians of {len(seeds)} seeds" if len(seeds) > 1 else ""
    lines = [
        f"{found.sim_seconds:.0f} s simulated in {found.wall_seconds:.0f} s ({dofs}{several}).",
        *found.verdict,
        f"Without and with compensation: {folder / 'film.gif'}",
        f"Tables, figures, {len(found.warnings)} warnings of the loop: {folder / 'report.html'}",
    ]
    print("\n".join(lines))


def _run_robot(options: argparse.Namespace) -> None:
    arguments.refuse_unused(options, "no --robot, which has no camera", "background", "disturb")
    arguments.refuse_unused(options, "1 with --robot", "seeds")
    config, make = choose_rig(options)
    seed = options.seed or 0
    robot.run(options, config, f"simulated {options.robot}, seed {seed}", make, seed=seed)


def _load(options: argparse.Namespace) -> Config:
    config = arguments.article_config(options.config, options.profile)
    given = {"seed": options.seed, "background": options.background}
    if options.disturb is not None:
        given["disturb"] = [name.strip() for name in options.disturb.split(",")]
    config = config.replace(**{f"twin.{k}": v for k, v in given.items() if v is not None})
    background = config.twin.background
    if background is not None and not Path(background).is_dir():
        raise MissingPathError("twin.background", background, "a folder of images")
    return config
