"""``tautscope run`` and ``tautscope bench``."""

from __future__ import annotations

import argparse
import json
import math
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.commands import arguments
from tautscope.commands.printing import print_json
from tautscope.config import load_config
from tautscope.dof import Dof
from tautscope.errors import ConfigError

if TYPE_CHECKING:
    from tautscope.report.results import DofResult

BENCH = "configs/bench.toml"


def add_parsers(verbs: arguments.Verbs) -> None:
    """Add the verbs to the command's."""
    run = verbs.add_parser(
        "run",
        allow_abbrev=False,
        help="run the article's experiment on the drives and camera of a configuration",
        description="Run the article's experiment on the drives and the camera of a configuration: "
        "motors move. Writes a folder with the log, tables, a figure of how punctual it was, and a "
        "report. However it ends, the motors are brought to quick stop. Research software, not a "
        "medical device; have an emergency stop within reach.",
    )
    run.add_argument("config", metavar="CONFIG.toml", help="the rig")
    arguments.add_profile(run, "how slack is compensated")
    run.add_argument(
        "--compare",
        action="store_true",
        help="run without compensation first, and print Table 1 as the camera sees it",
    )
    arguments.add_out(run, "run")
    arguments.add_json(run)
    run.set_defaults(run=_run)

    bench = verbs.add_parser(
        "bench",
        allow_abbrev=False,
        help="be a rig: simulated drives and a camera for `tautscope run`",
        description="Be a rig for another process: the simulated instrument behind three CiA 402 "
        "drives on a CAN bus and a camera stream, in real time. Ends with its input, or Ctrl-C. "
        "A line of input is a fault: KIND PART, with the part insertion, rotation, bending (drop, "
        "delay, fault, freeze, heartbeat, refuse) or camera (drop, delay, fault: unplugged, "
        "freeze); clear PART ends it. What happens is written as JSON lines.",
    )
    bench.add_argument("--config", default=BENCH, metavar="FILE", help="TOML file [%(default)s]")
    bench.add_argument(
        "--faults",
        nargs="+",
        type=_fault,
        default=[],
        metavar="'S KIND PART'",
        help="a fault S seconds after the motors were enabled",
    )
    bench.add_argument(
        "--truth", type=Path, metavar="FILE.csv", help="write where the tip is, for evaluation"
    )
    bench.add_argument(
        "--modes",
        type=int,
        nargs="+",
        default=[7, 8],
        metavar="N",
        help="modes of operation the drives have [7 8]",
    )
    bench.set_defaults(run=_bench)


def _fault(text: str) -> tuple[float, str]:
    seconds, _, request = text.partition(" ")
    try:
        return float(seconds), request
    except ValueError:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected 'SECONDS KIND PART'") from None


def _run(options: argparse.Namespace) -> int:
    from tautscope.commands.progress import progress_bar  # noqa: PLC0415
    from tautscope.hardware.experiment import (  # noqa: PLC0415
        run_on_hardware,
        write_run_folder,
    )
    from tautscope.runs.output_folder import default_folder  # noqa: PLC0415

    config = load_config(options.config, options.profile)
    folder = options.out or default_folder("run")
    try:
        with progress_bar("run") as progress:
            found = run_on_hardware(config, folder, progress, compare=options.compare)
    except KeyboardInterrupt as stop:
        notes = getattr(stop, "__notes__", ())
        print("\n".join(["interrupted; the motors are stopped", *notes]), file=sys.stderr)
        return 130
    write_run_folder(found, folder)
    if options.json:
        print_json(found.to_json())
        return 0
    timing = found.compensated.timing.summary()
    print(
        f"{timing['cycles']} cycles, {timing['lost_cycles']} lost; set-points at most "
        f"{timing['jitter_ms']['worst']:.2g} ms late; {timing['frames']} frames, age "
        f"{timing['frame_age_ms']['median']:.3g} ms (median)."
    )
    for dof, result in found.results.items():
        print(_seen(dof, result))
    for warning in found.compensated.recording.warnings:
        print(f"Warning: {warning}.")
    print(f"Report, figures and traces: {folder / 'report.html'}")
    return 0


def _seen(dof: Dof, found: DofResult) -> str:
    """What the camera saw of a DOF in a line; a dash for what is not known."""

    def shown(value: float) -> str:
        return "-" if math.isnan(value) else f"{dof.display_scale * value:.3g} {dof.display_unit}"

    line = f"{dof.label}: slack left {shown(found.compensated_estimate)}"
    if not math.isnan(found.uncompensated_estimate):
        gone = found.reduction_estimate
        share = "-" if math.isnan(gone) else f"{gone:.0%}"
        line += f" of {shown(found.uncompensated_estimate)}, reduction {share}"
    return f"{line}; tracking error {shown(found.tracking_estimate)} RMS; by camera"


def _bench(options: argparse.Namespace) -> None:
    from tautscope.bench.events import Reporter  # noqa: PLC0415
    from tautscope.bench.rig import Bench  # noqa: PLC0415
    from tautscope.hardware.realtime import (  # noqa: PLC0415
        SETPOINTS,
        little_collection,
        memory_kept,
        quick_switching,
        realtime,
    )
    from tautscope.hardware.signals import exit_on_signals  # noqa: PLC0415

    config = load_config(options.config)
    with (
        exit_on_signals(),
        quick_switching(),
        little_collection(),
        memory_kept(),
        realtime(SETPOINTS) as trouble,
        Bench(config, options.truth, modes=tuple(options.modes)) as bench,
    ):
        if trouble:
            print(f"warning: {trouble}", file=sys.stderr, flush=True)
        print(json.dumps({"time": time.monotonic(), "what": "ready"}), flush=True)
        reporter = Reporter(lambda: bench.events)
        ending = threading.Event()
        plan = threading.Thread(target=_play, args=(bench, sorted(options.faults), ending))
        plan.start()
        try:
            for line in sys.stdin:
                try:
                    bench.request(line)
                except ConfigError as error:
                    print(f"error: {error}", file=sys.stderr, flush=True)
        except KeyboardInterrupt:
            pass
        finally:
            ending.set()
            plan.join()
            reporter.close()


def _play(bench: object, faults: list[tuple[float, str]], ending: threading.Event) -> None:
    """Ask for each fault at its time after the motors were first enabled."""
    from tautscope.bench.rig import Bench  # noqa: PLC0415

    assert isinstance(bench, Bench)
    begun: float | None = None
    while faults and not ending.wait(0.01):
        if begun is None:
            enabled = [e.time for e in bench.events if e.what == "operation enabled"]
            begun = enabled[0] if enabled else None
        elif time.monotonic() >= begun + faults[0][0]:
            bench.request(faults.pop(0)[1])
