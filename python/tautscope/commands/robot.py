"""``tautscope demo --robot`` and ``tautscope run --rig``: an operator's motion on any robot."""

import argparse
import json
from collections.abc import Callable
from contextlib import closing
from functools import partial

from tautscope.commands import arguments
from tautscope.commands.calibration_rig import confirm_motion
from tautscope.commands.printing import announce, print_json, progress_bar
from tautscope.commands.result_lines import print_results
from tautscope.config import Config
from tautscope.hardware.signals import exit_on_signals
from tautscope.loop.rig import Rig, apply_reaction
from tautscope.report.operator_motion import motion_of
from tautscope.report.recorded_run import RecordedRun
from tautscope.runs.experiment import run_experiment
from tautscope.runs.output_folder import recording_saved
from tautscope.runs.recording import Recording

DURATION = 120.0
"""Duration of each of the two runs [s]."""
BYTES_PER_SECOND = 60e3, 40e3
"""Of logs and tables: of any robot, and of each degree of freedom beside that."""


def add_seconds(parser: argparse.ArgumentParser, of: str, default: float = DURATION) -> None:
    """``--seconds``."""
    parser.add_argument(
        "--seconds",
        type=arguments.above_zero,
        metavar="T",
        help=f"duration of a motion of {of} [{default:g} s]",
    )


def bytes_per_second(dofs: int) -> float:
    """Largest size of log and tables of a run per second."""
    of_any, of_each = BYTES_PER_SECOND
    return of_any + of_each * dofs


def run(
    options: argparse.Namespace,
    config: Config,
    name: str,
    make_rig: Callable[[Config], Rig],
    *,
    seed: int,
) -> None:
    """Run without and with compensation, print a line per degree of freedom, write the folder.

    The logs are written during the runs; also after SIGTERM and SIGHUP the rig is closed.
    """
    from tautscope.log.writer import run_log  # noqa: PLC0415

    arguments.refuse_unused(options, "--reference, and no --rig", "units")
    folder = arguments.out_folder(options)
    motion = motion_of(config, seed, options.seconds or DURATION)
    seconds = 2 * motion.duration
    announce("2 runs", seconds, seconds * bytes_per_second(len(config.dof)), folder)
    is_simulated = getattr(options, "rig", None) is None
    if not is_simulated:
        confirm_motion(options, "over up to 60 % of each range. Keep", config)
    runs: list[Recording] = []
    with recording_saved(folder), exit_on_signals(), progress_bar("2 runs") as progress:

        def report(now: float, end: float) -> None:
            progress((len(runs) + min(now / end, 1.0)) / 2)

        for suffix, compensate in (("_uncompensated", False), ("", True)):
            path = folder / f"{suffix[1:] or 'compensated'}.mcap"
            # The rig is closed first: its motors do not wait for the disk, in a tick or at the end.
            with (
                run_log(path, config, compensate=compensate, wait=is_simulated) as log,
                closing(make_rig(config)) as rig,
            ):
                watch = None if is_simulated else partial(apply_reaction, rig)
                runs.append(
                    run_experiment(rig, motion, config, compensate, report, log=log, watch=watch)
                )
            runs[-1].write(folder, suffix)
    found = RecordedRun(runs[1], runs[0])
    found.write_report(folder, {"rig": name})
    (folder / "run.json").write_text(json.dumps(found.summary(), indent=1), encoding="utf-8")
    print_json(options, {"folder": str(folder), **found.summary()})
    print_results(found, folder)
