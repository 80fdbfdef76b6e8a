"""The command ``tautscope calibrate latency``."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.commands import arguments
from tautscope.commands.align import NO_ANSWER, print_delay
from tautscope.commands.printing import print_json
from tautscope.config import Config, load_config
from tautscope.config.placeholders import refuse_placeholders
from tautscope.dof import Dof
from tautscope.errors import ConfigError

if TYPE_CHECKING:
    from tautscope.runs.recording import Recording

SHARE = 0.8
"""Amplitude and period of the motion over those of the experiment: the speed is the same."""
PERIODS = 3


def add_parser(kinds: arguments.Verbs) -> None:
    """Add the command to the parser of ``tautscope calibrate``."""
    latency = arguments.add_verb(
        kinds,
        "latency",
        help="delay of the images behind the motors",
        description="Estimate the delay of the images behind the motors, as `tautscope align`, and "
        "print camera.source.delay. Each DOF moves by a sine, without compensation, three periods "
        "within 80 % of the experiment's amplitude. THE MOTORS MOVE, unless a log or --twin is "
        "given; have an emergency stop within reach.",
        extras=["hardware"],
    )
    latency.add_argument(
        "file", type=Path, nargs="?", metavar="FILE.mcap", help="log of a run instead of a motion"
    )
    latency.add_argument("--twin", action="store_true", help="move the simulated instrument")
    arguments.add_out(latency, "latency")
    arguments.add_config(latency)
    arguments.add_json(latency)
    latency.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from tautscope.log.alignment import align_recording  # noqa: PLC0415

    recording = _recording(options)
    found = align_recording(recording)
    delay = recording.config.camera.source.delay + found.delay
    if options.json:
        print_json({**found.to_json(), "camera_delay": delay if found.is_known else None})
    else:
        print_delay(found)
        if found.is_known and delay >= 0:
            print(f"\n[camera.source]\ndelay = {delay:.4f}")
        elif found.is_known:
            print("The images are stamped before they are captured: check camera.source.clock.")
    return 0 if found.is_known else NO_ANSWER


def _recording(options: argparse.Namespace) -> Recording:
    """The recording of the log, or of a motion."""
    from tautscope.commands.progress import progress_bar  # noqa: PLC0415

    if options.file is not None:
        from tautscope.log.reader import read_log  # noqa: PLC0415

        return read_log(options.file).recording()
    config = _slow(load_config(options.config))
    if options.twin:
        from tautscope import Twin  # noqa: PLC0415
        from tautscope.loop.references import SineSequence  # noqa: PLC0415
        from tautscope.runs.experiment import run_experiment  # noqa: PLC0415

        with progress_bar("motion") as progress:
            return run_experiment(
                Twin(config),
                SineSequence(config.experiment),
                config,
                compensate=False,
                progress=lambda elapsed, duration: progress(elapsed / duration),
            )
    if config.drives is None:
        allowed = "a section [drives] that names the motors, a log, or --twin"
        raise ConfigError("drives", None, allowed)
    refuse_placeholders(options.config)
    from tautscope.hardware.experiment import run_on_hardware  # noqa: PLC0415
    from tautscope.runs.output_folder import check_free, default_folder  # noqa: PLC0415

    folder = check_free(options.out or default_folder("latency"))
    with progress_bar("motion") as progress:
        return run_on_hardware(config, folder, progress).compensated.recording


def _slow(config: Config) -> Config:
    """The configuration with the motion of the calibration, and without compensation."""
    changes: dict[str, object] = {"experiment.periods": PERIODS}
    for dof in Dof:
        sine = config.experiment[dof]
        changes[f"{dof.label}.free_gain"] = 1.0
        changes[f"experiment.{dof.label}.amplitude"] = SHARE * sine.amplitude
        changes[f"experiment.{dof.label}.period"] = SHARE * sine.period
    return config.replace(**changes)
