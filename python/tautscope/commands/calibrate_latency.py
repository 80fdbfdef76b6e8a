"""The command ``tautscope calibrate latency``."""

from __future__ import annotations

import argparse
import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.calibration.result import CalibrationResult
from tautscope.commands import arguments, calibration_output, calibration_rig, robot
from tautscope.commands.align import NO_ANSWER, print_delay
from tautscope.commands.printing import print_json
from tautscope.commands.rig_choice import add_rig
from tautscope.commands.robot_calibration import run_latency
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import CalibrationError, ConfigError, FieldError
from tautscope.extras import require_extras
from tautscope.runs.output_folder import check_free, default_folder
from tautscope.runs.recording import Recording

if TYPE_CHECKING:
    from tautscope.calibration.delay import DelayEstimate

SHARE = 0.8
"""Amplitude and period of the motion over those of the experiment: the speed is the same."""
PERIODS = 3
DISAGREEMENT = 3.0
"""Largest difference from the delay of the last calibration over its standard deviation."""


def add_parser(kinds: arguments.Verbs) -> None:
    """Add the command to the parser of ``tautscope calibrate``."""
    latency = arguments.add_verb(
        kinds,
        "latency",
        _run,
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
    latency.add_argument(
        "--log",
        type=Path,
        metavar="DIR",
        help="folder of the log of a motion on a rig, new or empty [runs/<date-time>-latency]",
    )
    add_rig(
        latency,
        "delay of the sensors of a rig of your own with [[dof]], as measurement.delays: a sweep of "
        "all degrees of freedom within 80 %% of their ranges",
    )
    robot.add_seconds(latency, "a rig", robot.DURATION / 2)
    calibration_rig.add_options(latency)
    calibration_output.add_options(latency)


def _run(options: argparse.Namespace) -> int:
    from tautscope.log.alignment import align_recording  # noqa: PLC0415

    file: Path | None = options.file
    if options.rig is not None and (file is not None or options.twin):
        raise FieldError("--rig", options.rig, "neither a file nor --twin")
    calibration_rig.check_options(options, is_motion=file is None)
    calibration_output.check_options(options, reads_config=file is None)
    if file is not None or options.rig is not None or options.twin:
        arguments.refuse_unused(options, "a motion of [drives], whose log it is", "log")
    if options.rig is None:
        arguments.refuse_unused(options, "--rig, whose motion it is", "seconds")
    else:
        require_extras("--rig", ["analysis"])
        run_latency(options)
        return 0
    recording, serial_numbers = _recording(options)
    found = align_recording(recording)
    print_delay(found)
    if not found.is_known:
        print_json(options, {**found.to_json(), "camera_delay": None})
        return NO_ANSWER
    calibration_output.finish(options, result(found, recording.config, serial_numbers))
    return 0


def result(
    found: DelayEstimate, config: Config, serial_numbers: Mapping[str, str]
) -> CalibrationResult:
    """The delay in the form that all calibrations have.

    The configured delay may be that of a calibration, of the geometry or of the latency. The value
    with the smaller standard deviation is kept; if both disagree, there is no answer.

    Raises:
        CalibrationError: There is no answer, or the images are stamped before they are captured.
    """
    if not found.is_known:
        remedy = "Give camera.source.delay yourself, or leave out this step: docs/recordings.md"
        raise CalibrationError(f"The delay is unknown: {found.reason}", remedy)
    key, before = "camera.source.delay", config.camera.source.delay
    delay, std = before + found.delay, found.delay_std
    if delay < -2 * std:
        what = f"The images are stamped {-1e3 * delay:.0f} ms before they are captured"
        raise CalibrationError(what, "Check camera.source.clock")
    shown = f"delay {1e3 * delay:.1f} ms, standard deviation {1e3 * std:.1f} ms"
    delay = max(delay, 0.0)
    notes = (f"{shown}; it was {1e3 * before:.1f} ms",)
    kinds = ((name, getattr(config.calibration, name)) for name in ("geometry", "latency"))
    records = [(each.at, name, each.std[key]) for name, each in kinds if each and key in each.std]
    if records:
        _, name, other = max(records)
        known = f"{1e3 * before:.1f} ms, standard deviation {1e3 * other:.1f} ms"
        if abs(found.delay) > DISAGREEMENT * math.hypot(std, other):
            what = f"The motion gives a {shown}, the calibration of the {name} {known}"
            remedy = "Repeat that of the geometry, then this, with the instrument free and in view"
            raise CalibrationError(what, remedy)
        if other < std:
            delay, std = before, other
            notes = (f"{shown}; kept: that of the {name}, {known}",)
    return CalibrationResult(
        "latency",
        {key: delay},
        {key: std},
        serial_numbers=serial_numbers,
        notes=notes,
        data={**found.to_json(), "camera_delay": delay},
    )


def _recording(options: argparse.Namespace) -> tuple[Recording, Mapping[str, str]]:
    """The recording of the log, or of a motion, and the devices that took part."""
    if options.file is not None:
        from tautscope.log.reader import read_log  # noqa: PLC0415

        return read_log(options.file).recording(), {}
    config = arguments.article_config(options.config)
    if not options.twin:
        if config.drives is None:
            allowed = "a section [drives] that names the motors, a log, or --twin"
            raise ConfigError("drives", None, allowed)
        calibration_rig.refuse_wrong_limits(options.config)
        calibration_rig.confirm_motion(options, calibration_rig.ARTICLE_MOTION, config)
    return record(options, config, check_free(options.log or default_folder("latency")))


def record(
    options: argparse.Namespace, config: Config, folder: Path
) -> tuple[Recording, Mapping[str, str]]:
    """Move the rig, which logs it in a folder, or the twin: the recording and the devices.

    Gains of 1 are no compensation.
    """
    changes: dict[str, object] = {"experiment.periods": PERIODS, "law.free_gain": 1.0}
    for dof in Dof:
        sine = config.experiment[dof]
        changes[f"{dof.label}.free_gain"] = 1.0
        changes[f"experiment.{dof.label}.amplitude"] = SHARE * sine.amplitude
        changes[f"experiment.{dof.label}.period"] = SHARE * sine.period
    if options.twin:
        serial_numbers = calibration_rig.twin_device(options, config)
    else:
        from tautscope.hardware.serial_numbers import read_serial_numbers  # noqa: PLC0415

        serial_numbers = read_serial_numbers(config)
    config = config.replace(**changes)
    recording, _ = calibration_rig.run_protocol(options, config, folder, "motion")
    return recording, serial_numbers
