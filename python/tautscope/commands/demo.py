"""``tautscope demo``."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tautscope.commands import arguments, robot
from tautscope.commands.printing import (
    announce,
    console,
    print_json,
    print_table,
    progress_bar,
)
from tautscope.commands.rig_choice import add_robot, choose_rig
from tautscope.config import DISTURBANCES, Config
from tautscope.errors import FieldError, MissingPathError
from tautscope.loop.references import SineSequence
from tautscope.report.operator_motion import OPERATOR_ROWS
from tautscope.report.results import ROWS
from tautscope.report.rows import Row
from tautscope.runs.output_folder import recording_saved

if TYPE_CHECKING:
    from tautscope.dof import NamedDof
    from tautscope.report.demo import Demo

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
    if options.seconds is not None:
        raise FieldError("--seconds", options.seconds, "--robot")
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
    _print_table1(found)
    _print_operator_motion(found)
    _print_facts(found, folder)


def _run_robot(options: argparse.Namespace) -> None:
    for name in ("background", "disturb"):
        if getattr(options, name) is not None:
            raise FieldError(f"--{name}", getattr(options, name), "no --robot, which has no camera")
    if options.seeds != 1:
        raise FieldError("--seeds", options.seeds, "1 with --robot")
    config, make = choose_rig(options)
    seed = options.seed or 0
    robot.run(options, config, f"simulated {options.robot}, seed {seed}", make, seed=seed)


def _load(options: argparse.Namespace) -> Config:
    config = arguments.article_config(options.config, options.profile)
    changes: dict[str, Any] = {}
    if options.seed is not None:
        changes["twin.seed"] = options.seed
    if options.background is not None:
        changes["twin.background"] = options.background
    if options.disturb is not None:
        changes["twin.disturb"] = [name.strip() for name in options.disturb.split(",")]
    config = config.replace(**changes)
    background = config.twin.background
    if background is not None and not Path(background).is_dir():
        raise MissingPathError("twin.background", background, "a folder of images")
    return config


def _title(text: str, seeds: int) -> str:
    return f"{text} (median of {seeds} seeds, worst in brackets)" if seeds > 1 else text


def _cell(row: Row, dof: NamedDof, results: Sequence[dict[NamedDof, Any]]) -> str:
    """The median of a figure of a DOF, and of several seeds the worst one in brackets."""
    from tautscope.report import tables  # noqa: PLC0415
    from tautscope.report.results import combine  # noqa: PLC0415

    middle, bad = (
        tables.cell(row, dof, getattr(combine(results, how)[dof], row.name))
        for how in ("median", "worst")
    )
    return f"{middle} ({bad})" if len(results) > 1 else middle


def _print_table1(demo: Demo) -> None:
    from tautscope.report import tables  # noqa: PLC0415

    profiles, dofs = demo.by_profile, list(demo.results[0])
    headings, rows = [""], []
    for dof in dofs:
        headings += [f"{tables.heading(dof)}\narticle", *(f"\n{name}" for name in profiles)]
    for row in ROWS:
        cells = []
        for dof in dofs:
            cells.append(tables.article_cell(row, dof))
            cells += [_cell(row, dof, results) for results in profiles.values()]
        rows.append([row.title, *cells])
    title = _title("Table 1: the article, and the twin", len(demo.seeds))
    print_table(headings, rows, title=title, dim=range(1, len(headings), len(profiles) + 1))
    print("Widths in the last two periods, of the true tip unless stated otherwise.\n")


def _print_operator_motion(demo: Demo) -> None:
    from tautscope.report import tables  # noqa: PLC0415

    results = demo.operator_results
    dofs = list(results[0])
    rows = [[row.title, *(_cell(row, dof, results) for dof in dofs)] for row in OPERATOR_ROWS]
    title = f"Operator motion, all degrees of freedom at once, profile {demo.config.profile}"
    headings = ["", *map(tables.heading, dofs)]
    print_table(headings, rows, title=_title(title, len(results)))
    print("Errors of the true tip, after the first 40 s.\n")


def _print_facts(demo: Demo, folder: Path) -> None:
    screen = console()
    screen.print(f"{demo.sim_seconds:.0f} s simulated in {demo.wall_seconds:.0f} s.")
    for line in demo.warnings:
        screen.print(f"Warning: {line}.", soft_wrap=True)
    screen.print(f"Without and with compensation: {folder / 'film.gif'}", soft_wrap=True)
    screen.print(f"Report, figures and traces: {folder / 'report.html'}", soft_wrap=True)
