"""The command ``tautscope calibrate geometry``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.commands import arguments
from tautscope.commands.article_config import article_config
from tautscope.commands.calibration_output import add_options, check_options, finish
from tautscope.commands.calibration_rig import add_rig_options, confirm_motion, open_rig
from tautscope.commands.printing import print_json
from tautscope.config import Config
from tautscope.errors import FieldError, RecordError
from tautscope.extras import require_extras

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tautscope.calibration.geometry import GeometryFit, Recording
    from tautscope.calibration.result import CalibrationResult


@dataclass(frozen=True)
class _Source:
    """A recorded motion, the configuration before, and the devices that took part."""

    recording: Recording
    config: Config
    serial_numbers: Mapping[str, str] = field(default_factory=dict)


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
    geometry.add_argument(
        "--motors", type=Path, metavar="FILE.csv", help="motor positions of a video"
    )
    geometry.add_argument(
        "--video-start",
        type=arguments.seconds,
        default=0.0,
        metavar="S",
        help="time of the video's first frame in the CSV's [s] [%(default)s]",
    )
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
    add_rig_options(geometry)
    add_options(geometry)


def _run(options: argparse.Namespace) -> int:
    from tautscope.calibration.geometry import fit  # noqa: PLC0415

    check_options(options)
    source = _source(options)
    distance = None if options.band_distance is None else options.band_distance * 1e-3
    found = fit(
        source.recording, source.config, intrinsics=options.intrinsics, band_distance=distance
    )
    if not found.is_plausible:
        return _refuse(options, found)
    if not options.json:
        print("\n".join(f"# {line}" for line in table(found)))
    with _overlay(options, found, source.config):
        with_figures = options.out is not None
        finish(options, result(found, source.serial_numbers, with_figures=with_figures))
    return 0


def _source(options: argparse.Namespace) -> _Source:
    file: Path | None = options.file
    if file is not None and options.twin:
        raise FieldError("file", str(file), "no file together with --twin")
    if options.motors is not None and (file is None or file.suffix == ".mcap"):
        raise FieldError("--motors", str(options.motors), "a video together with --motors")
    if file is None:
        return _from_twin(options) if options.twin else _from_hardware(options)
    if file.suffix == ".mcap":
        return _from_log(options)
    if options.motors is None:
        raise FieldError("file", str(file), "a log (.mcap), or a video with --motors")
    return _from_video(options)


def _from_log(options: argparse.Namespace) -> _Source:
    from tautscope.calibration.geometry import Recorder  # noqa: PLC0415
    from tautscope.log.reader import Tick, Update, read_log  # noqa: PLC0415
    from tautscope.runs.recording import FRAME_COLUMNS  # noqa: PLC0415

    log = read_log(options.file)
    config = log.config if options.config is None else article_config(options.config)
    recorder = Recorder(config)
    captured = (FRAME_COLUMNS.names or ()).index("captured_at")
    for index, event in log.events.items():
        if isinstance(event, Tick):
            recorder.add_tick(event.sample.time, event.sample.applied)
        elif isinstance(event, Update) and log.has_image(index):
            captured_at = float(event.row[captured])  # type: ignore[arg-type]
            if recorder.is_due(captured_at):
                recorder.add_image(log.image(index), captured_at)
    return _Source(recorder.recording(), config)


def _from_video(options: argparse.Namespace) -> _Source:
    from tautscope.calibration.geometry import Recorder  # noqa: PLC0415
    from tautscope.hardware.video import read_video  # noqa: PLC0415
    from tautscope.runs.records import read_motors  # noqa: PLC0415

    config = article_config(options.config)
    times, positions = read_motors(options.motors)
    recorder = Recorder(config)
    for time, position in zip(times, positions, strict=True):
        recorder.add_tick(float(time), position)
    for frame in read_video(str(options.file), config.camera, options.video_start):
        if times[0] <= frame.captured_at <= times[-1] and recorder.is_due(frame.captured_at):
            recorder.add_image(frame.image, frame.captured_at)
    return _Source(recorder.recording(), config)


def _from_twin(options: argparse.Namespace) -> _Source:
    require_extras("--twin", ["twin"])
    from tautscope.calibration.geometry import sweep  # noqa: PLC0415
    from tautscope.commands.progress import progress_bar  # noqa: PLC0415
    from tautscope.twin import Twin  # noqa: PLC0415
    from tautscope.twin.drawn_rig import draw_geometry  # noqa: PLC0415

    config = article_config(options.config)
    seed = config.twin.seed if options.seed is None else options.seed
    rig = Twin(draw_geometry(config, seed))
    try:
        with progress_bar("sweep") as progress:
            return _Source(sweep(rig, config, progress=progress), config)
    finally:
        rig.close()


def _from_hardware(options: argparse.Namespace) -> _Source:
    from tautscope.calibration.geometry import sweep  # noqa: PLC0415
    from tautscope.commands.progress import progress_bar  # noqa: PLC0415
    from tautscope.hardware.realtime import VISION, realtime_executor  # noqa: PLC0415

    if options.config is None:
        raise FieldError("--config", None, "the configuration of a rig; or a file, or --twin")
    config = article_config(options.config)
    confirm_motion(options)
    with (
        realtime_executor("vision", VISION) as executor,
        open_rig(config) as setup,
        progress_bar("sweep") as progress,
    ):
        recording = sweep(setup.rig, config, executor=executor, progress=progress)
        return _Source(recording, config, setup.serial_numbers)


def _refuse(options: argparse.Namespace, found: GeometryFit) -> int:
    """Say why the result is not used; nothing is written."""
    if options.json:
        print_json({"is_plausible": False, "warnings": list(found.warnings)})
        return 1
    print("\n".join(f"# {line}" for line in table(found)))
    for warning in found.warnings:
        print(f"warning: {warning}.", file=sys.stderr)
    print("The model does not explain this record. Nothing was written.", file=sys.stderr)
    return 1


@contextmanager
def _overlay(options: argparse.Namespace, found: GeometryFit, before: Config) -> Iterator[None]:
    """After the block has made the output folder, write the overlay video into it."""
    yield
    if options.out is not None and found.recording.patches:
        from tautscope.report.geometry_figures import write_overlay  # noqa: PLC0415

        write_overlay(found, before, options.out / "overlay.avi")


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
    """The result in the form that all calibrations have.

    Raises:
        RecordError: The model does not explain the record.
    """
    from tautscope.calibration.result import CalibrationResult  # noqa: PLC0415

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
