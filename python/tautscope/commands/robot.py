"""``tautscope demo --robot`` and ``tautscope run --rig``: an operator's motion on any robot."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from tautscope.commands import arguments
from tautscope.commands.held_run import recording_saved
from tautscope.commands.printing import announce, console, print_json
from tautscope.config import Config
from tautscope.loop.rig import Rig

if TYPE_CHECKING:
    from tautscope.report.robot_run import RobotRun

DURATION = 120.0
"""Duration of each of the two runs [s]."""
BYTES_PER_SECOND = 60e3


def add_seconds(parser: argparse.ArgumentParser, of: str, default: float = DURATION) -> None:
    """``--seconds``."""
    parser.add_argument(
        "--seconds",
        type=arguments.above_zero,
        metavar="T",
        help=f"duration of a motion of {of} [{default:g} s]",
    )


def run(
    options: argparse.Namespace,
    config: Config,
    make_rig: Callable[[Config], Rig],
    verb: str,
    *,
    seed: int,
) -> None:
    """Run without and with compensation, print a line per degree of freedom, write the folder."""
    from tautscope.commands.progress import progress_bar  # noqa: PLC0415
    from tautscope.report.robot_run import (  # noqa: PLC0415
        motion_of,
        run_robot,
        write_robot_folder,
    )
    from tautscope.runs.output_folder import check_free, default_folder  # noqa: PLC0415

    folder = check_free(options.out or default_folder(verb))
    motion = motion_of(config, seed, options.seconds or DURATION)
    seconds = 2 * motion.duration
    announce("2 runs", seconds, seconds * BYTES_PER_SECOND, folder)
    with recording_saved(folder), progress_bar("2 runs") as progress:
        found = run_robot(make_rig, config, motion, progress)
    write_robot_folder(found, folder)
    if options.json:
        print_json({"folder": str(folder), **found.to_json()})
        return
    _print(found)
    for warning in found.compensated.warnings:
        print(f"Warning: {warning}.")
    print(f"Figure and traces: {folder / 'motion.png'}")


def _print(found: RobotRun) -> None:
    from rich.table import Table  # noqa: PLC0415

    table = Table(box=None, pad_edge=False)
    table.add_column("tip less reference, RMS", no_wrap=True)
    for title in ("without", "with compensation", "less by", "largest", "slack found"):
        table.add_column(title, justify="right")
    for result, dof in zip(found.results, found.compensated.config.dofs, strict=True):
        shown = (
            f"{dof.display_scale * value:.3g}"
            for value in (result.uncompensated_rms, result.compensated_rms)
        )
        rest = (f"{dof.display_scale * value:.3g}" for value in (result.largest, result.slack))
        less = f"{result.reduction:.0%}"
        table.add_row(f"{result.name} [{result.unit}]", *shown, less, *rest)
    console().print(table)
    if np.isnan(found.compensated.trace[f"true_{found.results[0].name}"]).all():
        print("The tip is the one measured: this rig does not know its true tip.")
