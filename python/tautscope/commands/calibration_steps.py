"""The steps of ``tautscope calibrate all``: each turns a configuration into a result."""

import argparse
import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from tautscope.calibration.result import CalibrationResult
from tautscope.commands import (
    calibrate_camera,
    calibrate_colour,
    calibrate_geometry,
    calibrate_latency,
)
from tautscope.commands.calibration_rig import run_protocol
from tautscope.commands.doctor import run_checks
from tautscope.commands.result_lines import summary_line
from tautscope.config import Config
from tautscope.dof import display_text
from tautscope.errors import CalibrationError
from tautscope.hardware.doctor.calibration import check_calibration
from tautscope.report.results import evaluate

MOTION_PERIODS = 3
"""Periods per DOF of the first compensated motion."""
MOTION = "motion"


@dataclass(frozen=True)
class Step:
    """One step.

    Attributes:
        name: ``camera``, ``colour``, ...
        title: For the report.
        todo: What the user has to prepare.
        run: Takes the options of the command, the configuration as it is then, and a folder for
            its own files; the result has no values if it only checks.
    """

    name: str
    title: str
    todo: str
    run: Callable[[argparse.Namespace, Config, Path], CalibrationResult]


def _camera(options: argparse.Namespace, config: Config, folder: Path) -> CalibrationResult:
    result, info = calibrate_camera.calibrate(options)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "camera_info.yaml").write_text(info, encoding="utf-8")
    return result


def _colour(options: argparse.Namespace, config: Config, folder: Path) -> CalibrationResult:
    return calibrate_colour.calibrate(options)


def _geometry(options: argparse.Namespace, config: Config, folder: Path) -> CalibrationResult:
    from tautscope.calibration.geometry import Intrinsics, fit  # noqa: PLC0415

    recording, _, serial_numbers = calibrate_geometry.move(options)
    # A board determines the intrinsics better than the instrument.
    intrinsics: Intrinsics = "focal" if config.calibration.camera is None else "none"
    found = fit(recording, config, intrinsics=intrinsics)
    result = calibrate_geometry.result(found, serial_numbers)
    return replace(result, notes=(f"residual {found.residual_px:.2g} px", *result.notes))


def _latency(options: argparse.Namespace, config: Config, folder: Path) -> CalibrationResult:
    from tautscope.log.alignment import align_recording  # noqa: PLC0415

    place = _unused(folder, "latency")
    recording, serial_numbers = calibrate_latency.record(options, config, place)
    return calibrate_latency.result(align_recording(recording), config, serial_numbers)


def _doctor(options: argparse.Namespace, config: Config, folder: Path) -> CalibrationResult:
    if options.twin:
        findings = check_calibration(config.calibration, {}, options.config)
    else:
        findings = list(run_checks(config, options.config))
    lines = [f"{each.status}: {each.what}: {each.found}" for each in findings]
    missing = [each for each in findings if each.status == "missing"]
    if missing:
        what = "; ".join(f"{each.what}: {each.found}" for each in missing)
        remedy = "; ".join(each.todo for each in missing if each.todo)
        raise CalibrationError(f"doctor does not approve the rig: {what}", remedy)
    return CalibrationResult("doctor", {}, notes=tuple(lines))


def _motion(options: argparse.Namespace, config: Config, folder: Path) -> CalibrationResult:
    from tautscope.report import figures  # noqa: PLC0415

    config = config.replace(**{"experiment.periods": MOTION_PERIODS})
    place = _unused(folder, MOTION)
    recording, run = run_protocol(options, config, place, "first compensated motion")
    if run is None:
        place.mkdir(parents=True)
        recording.write(place)
    else:
        from tautscope.hardware.run_results import write_run_folder  # noqa: PLC0415

        write_run_folder(run, place)
    results = evaluate(None, recording)
    figure = figures.figure9(None, recording)
    notes = [summary_line(dof, result) for dof, result in results.items()]
    if options.twin:
        notes += [
            f"{dof.label}: true remaining slack {display_text([result.compensated], [dof])}"
            f"{', crossed too far' * (result.compensated < 0)}"
            for dof, result in results.items()
        ]
    caption = (
        "First compensated motion: reference, command, estimate and contact offsets; below, the "
        "loops of the estimate over the reference."
    )
    warnings = tuple(f"Warning: {each}" for each in recording.warnings)
    return CalibrationResult(MOTION, {}, notes=(*notes, *warnings), figures=((figure, caption),))


def _unused(folder: Path, name: str) -> Path:
    """A folder that does not exist; a motion that failed has left its log in one."""
    names = (folder / (f"{name}-{k}" if k else name) for k in itertools.count())
    return next(each for each in names if not each.exists())


STEPS = (
    Step(
        "camera",
        "Camera",
        "Show the printed board (`tautscope calibrate camera --board board.pdf`) to the camera, in "
        "all parts of the image, tilted to all sides; hold it still in each pose.",
        _camera,
    ),
    Step(
        "colour",
        "Colour of the bands",
        "Bring the instrument with both bands into view, and hold the scope still. THE MOTORS OF "
        "INSERTION AND BENDING MOVE for 10 s.",
        _colour,
    ),
    Step(
        "geometry",
        "Geometry",
        "The same. ALL MOTORS MOVE for a minute; the tip must be free.",
        _geometry,
    ),
    Step(
        "latency",
        "Delay of the images",
        "The same. ALL MOTORS MOVE in turn, for 72 s with the default experiment.",
        _latency,
    ),
    Step("doctor", "Check of the rig", "No motor is enabled.", _doctor),
    Step(
        MOTION,
        "First compensated motion",
        "ALL MOTORS MOVE in turn, for 90 s with the default experiment; a hand at the emergency "
        "stop.",
        _motion,
    ),
)
