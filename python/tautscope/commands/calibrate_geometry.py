"""The command ``tautscope calibrate geometry``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.calibration.result import CalibrationResult
from tautscope.commands import arguments, calibration_output, calibration_rig, positions
from tautscope.commands.printing import print_json, print_warnings, progress_bar
from tautscope.config import Config
from tautscope.errors import FieldError, RecordError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tautscope.calibration.geometry import GeometryFit, Recording


def add_parser(kinds: arguments.Verbs) -> None:
    """Add the command to the parser of ``tautscope calibrate``."""
    geometry = arguments.add_verb(
        kinds,
        "geometry",
        _run,
        help="pose of the channel, lengths and delay, from the instrument's own motion",
        description="Estimate the pose of the channel in the camera frame, the lengths of section "
        "and bands, focal length and delay of the images, with standard deviations. Without a "
        "file, the rig of --config or the twin moves all three motors at once for a minute within "
        "the range of [experiment]; THE MOTORS MOVE. The tip must be free and in view.",
        extras=["hardware"],
    )
    geometry.add_argument(
        "file",
        nargs="?",
        type=Path,
        metavar="FILE",
        help="a log (.mcap), or a video with --motors",
    )
    positions.add_motor_options(geometry)
    geometry.add_argument(
        "--intrinsics",
        choices=("none", "focal", "all"),
        default="focal",
        help="estimate none of the camera's intrinsic values, one factor of both focal lengths, "
        "or focal lengths, principal point and k1 [%(default)s]",
    )
    geometry.add_argument(
        "--band-distance",
        type=arguments.above_zero,
        metavar="MM",
        help="measured distance of the bands' centres, as the scale of all lengths [the travel of "
        "the insertion drive]",
    )
    calibration_rig.add_options(geometry)
    calibration_output.add_options(geometry)


def _run(options: argparse.Namespace) -> int:
    from tautscope.calibration.geometry import Recorder, fit  # noqa: PLC0415

    file: Path | None = options.file
    calibration_rig.check_options(options, is_motion=file is None)
    positions.check_motor_options(options, file)
    calibration_output.check_options(options)
    serial_numbers: Mapping[str, str] = {}
    if file is None:
        _band_distance(options, arguments.article_config(options.config))  # before anything moves
        recording, config, serial_numbers = move(options)
    else:
        recorder, config = positions.read_motion(options, file, Recorder)
        recording = recorder.recording()
    distance = _band_distance(options, config)
    found = fit(recording, config, intrinsics=options.intrinsics, band_distance=distance)
    print("\n".join(f"# {line}" for line in table(found)))
    if not found.is_plausible:
        print_json(options, {"is_plausible": False, "warnings": list(found.warnings)})
        print_warnings(found.warnings)
        print("The model does not explain this record. Nothing was written.", file=sys.stderr)
        return 1
    found_result = result(found, serial_numbers, with_figures=options.out is not None)
    calibration_output.finish(options, found_result)
    if options.out is not None and found.recording.patches:
        from tautscope.report.geometry_figures import write_overlay  # noqa: PLC0415

        write_overlay(found, config, options.out / "overlay.avi")
    return 0


def _band_distance(options: argparse.Namespace, config: Config) -> float | None:
    """The distance of ``--band-distance`` [m]."""
    if options.band_distance is None:
        return None
    least = 1e3 * config.instrument.band_length
    if options.band_distance <= least:
        allowed = f"a distance in mm, above {least:.3g}, the length of a band"
        raise FieldError("--band-distance", options.band_distance, allowed)
    return float(options.band_distance) * 1e-3


def move(options: argparse.Namespace) -> tuple[Recording, Config, Mapping[str, str]]:
    """The record of a sweep of the rig or the twin, its configuration and its devices."""
    from tautscope.calibration.geometry import sweep  # noqa: PLC0415

    with (
        calibration_rig.open_rig(options, camera_is_known=True) as setup,
        progress_bar("sweep") as progress,
    ):
        recording = sweep(setup.rig, setup.config, executor=setup.executor, progress=progress)
        return recording, setup.config, setup.serial_numbers


def table(found: GeometryFit) -> list[str]:
    """Lines of a table: each value before and after, with its standard deviation."""
    lines = [f"{'value':<42}{'before':>11}{'after':>11}{'std before':>12}{'std':>9}  unit"]
    for value in found.values:
        before, after, prior, std = (
            value.shown * each for each in (value.before, value.after, value.prior_std, value.std)
        )
        lines.append(
            f"{value.name:<42}{before:>11.3f}{after:>11.3f}{prior:>12.3g}{std:>9.2g}  {value.unit}"
        )
    share = f"both bands in {found.found_share:.0%} of {len(found.recording.captured_at)} images"
    lines.append(f"residual {found.residual_px:.2g} px RMS, {share}")
    return lines


def result(
    found: GeometryFit, serial_numbers: Mapping[str, str], *, with_figures: bool = True
) -> CalibrationResult:
    """The result in the form that all calibrations have; an error if it is not plausible."""
    if not found.is_plausible:
        raise RecordError(
            "recording", "; ".join(found.warnings), "a record that the model explains"
        )
    figures: tuple[tuple[Figure, str], ...] = ()
    if with_figures:
        from tautscope.report.geometry_figures import residual_figure  # noqa: PLC0415

        caption = "Residuals of the bands, and the tip over the motors (grey: expected)."
        figures = ((residual_figure(found), caption),)
    return CalibrationResult(
        "geometry",
        found.changes,
        std=found.std,
        residual=found.residual_px,
        serial_numbers=serial_numbers,
        notes=found.warnings,
        figures=figures,
        data={
            "found_share": found.found_share,
            "parameters": {
                value.name: {"before": value.before, "after": value.after, "std": value.std}
                for value in found.values
            },
        },
    )
