"""The command ``tautscope calibrate geometry``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.commands import arguments
from tautscope.commands.calibration_output import add_options, check_options, finish
from tautscope.commands.printing import print_json
from tautscope.config import Config, load_config
from tautscope.config.placeholders import MARK, placeholders
from tautscope.errors import ConfigError, FieldError, RecordError
from tautscope.extras import require_extras

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tautscope.calibration.geometry import GeometryFit, Recording
    from tautscope.calibration.result import CalibrationResult

FOUND_HERE = (
    "camera.fx",
    "camera.fy",
    "camera.camera_from_guide",
    "camera.source.delay",
    "instrument",
)
"""Sections and keys that may be placeholders: rough values of them suffice."""


def add_parser(kinds: arguments.Verbs) -> None:
    """Add the command to the parser of ``tautscope calibrate``."""
    geometry = arguments.add_verb(
        kinds,
        "geometry",
        help="pose of the channel, lengths and delay, from the instrument's own motion",
        description="Estimate the pose of the channel in the camera frame, the lengths of section "
        "and bands, focal length and delay of the images, with standard deviations. Moves all "
        "three motors at once for a minute within the range of [experiment]: THE MOTORS MOVE; or "
        "takes a log, or a video with motor positions. The tip must be free and in view.",
        extras=["hardware"],
    )
    source = geometry.add_mutually_exclusive_group()
    source.add_argument("--log", type=Path, metavar="FILE.mcap", help="use the images of a log")
    source.add_argument("--video", metavar="FILE", help="use a video; needs --motors")
    source.add_argument(
        "--twin", action="store_true", help="calibrate a simulated rig that differs from --config"
    )
    geometry.add_argument("--motors", type=Path, metavar="FILE.csv", help="motor positions")
    geometry.add_argument(
        "--video-start",
        type=arguments.seconds,
        default=0.0,
        metavar="S",
        help="time of the video's first frame in the CSV's [s] [%(default)s]",
    )
    geometry.add_argument(
        "--seed",
        type=arguments.natural,
        metavar="N",
        help="seed of the twin and of its differences [twin.seed of the configuration]",
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
    geometry.add_argument("--yes", action="store_true", help="move the motors without asking")
    add_options(geometry)
    geometry.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    from tautscope.calibration.geometry import fit  # noqa: PLC0415

    check_options(options)
    if (options.video is None) != (options.motors is None):
        raise FieldError("--motors", options.motors, "a CSV file together with --video")
    config, recording = _record(options)
    distance = None if options.band_distance is None else options.band_distance * 1e-3
    found = fit(recording, config, intrinsics=options.intrinsics, band_distance=distance)
    if not found.is_plausible:
        return _refuse(options, found)
    if not options.json:
        print("\n".join(f"# {line}" for line in table(found)))
    with _overlay(options, found, config):
        finish(options, result(found, with_figures=options.out is not None))
    return 0


def _record(options: argparse.Namespace) -> tuple[Config, Recording]:
    """The configuration before, and the motion from the source that the options name."""
    if options.log is not None:
        return _from_log(options)
    config = load_config(options.config)
    if options.video is not None:
        return config, _from_video(options, config)
    if options.twin:
        return config, _from_twin(options, config)
    return config, _from_hardware(options, config)


def _from_log(options: argparse.Namespace) -> tuple[Config, Recording]:
    from tautscope.calibration.geometry import Recorder  # noqa: PLC0415
    from tautscope.calibration.geometry.sweep import IMAGE_PERIOD  # noqa: PLC0415
    from tautscope.log.reader import Tick, Update, read_log  # noqa: PLC0415
    from tautscope.runs.recording import FRAME_COLUMNS  # noqa: PLC0415

    log = read_log(options.log)
    config = log.config if options.config is None else load_config(options.config)
    recorder, due = Recorder(config), -float("inf")
    captured = (FRAME_COLUMNS.names or ()).index("captured_at")
    for index, event in log.events.items():
        if isinstance(event, Tick):
            recorder.add_tick(event.sample.time, event.sample.applied)
        elif isinstance(event, Update) and log.has_image(index):
            at = float(event.row[captured])  # type: ignore[arg-type]
            if at >= due:
                recorder.add_image(log.image(index), at)
                due = at + IMAGE_PERIOD - 1e-9
    return config, recorder.recording()


def _from_video(options: argparse.Namespace, config: Config) -> Recording:
    from tautscope.calibration.geometry import Recorder  # noqa: PLC0415
    from tautscope.calibration.geometry.sweep import IMAGE_PERIOD  # noqa: PLC0415
    from tautscope.hardware.video import read_video  # noqa: PLC0415
    from tautscope.runs.records import read_motors  # noqa: PLC0415

    times, positions = read_motors(options.motors)
    recorder, due = Recorder(config), -float("inf")
    for time, position in zip(times, positions, strict=True):
        recorder.add_tick(float(time), position)
    for frame in read_video(options.video, config.camera, options.video_start):
        if times[0] <= frame.captured_at <= times[-1] and frame.captured_at >= due:
            recorder.add_image(frame.image, frame.captured_at)
            due = frame.captured_at + IMAGE_PERIOD - 1e-9
    return recorder.recording()


def _from_twin(options: argparse.Namespace, config: Config) -> Recording:
    require_extras("--twin", ["twin"])
    from tautscope.calibration.geometry import sweep  # noqa: PLC0415
    from tautscope.commands.progress import progress_bar  # noqa: PLC0415
    from tautscope.twin import Twin  # noqa: PLC0415
    from tautscope.twin.drawn_rig import draw_geometry  # noqa: PLC0415

    seed = config.twin.seed if options.seed is None else options.seed
    rig = Twin(draw_geometry(config, seed))
    try:
        with progress_bar("sweep") as progress:
            return sweep(rig, config, progress=progress)
    finally:
        rig.close()


def _from_hardware(options: argparse.Namespace, config: Config) -> Recording:
    from tautscope.calibration.geometry import sweep  # noqa: PLC0415
    from tautscope.commands.progress import progress_bar  # noqa: PLC0415
    from tautscope.hardware.realtime import (  # noqa: PLC0415
        OTHERS,
        VISION,
        limited_garbage_collection,
        locked_memory,
        realtime,
        set_realtime_priority,
    )
    from tautscope.hardware.rig import HardwareRig  # noqa: PLC0415
    from tautscope.hardware.signals import exit_on_signals  # noqa: PLC0415

    if options.config is None:
        raise FieldError("--config", None, "the configuration of a rig; or --twin, --log, --video")
    _refuse_other_placeholders(options.config)
    rig = HardwareRig(config)
    if not options.yes:
        question = (
            "All three motors will move at once for a minute, within the range of [experiment]. "
            "Type y to start: "
        )
        print(question, end="", file=sys.stderr, flush=True)
        if sys.stdin.readline().strip().lower() not in ("y", "yes"):
            raise FieldError("answer", "no", "y, or the option --yes; nothing moved")
    with ExitStack() as stack:
        for context in (
            exit_on_signals(),
            limited_garbage_collection(),
            locked_memory(),
            realtime(OTHERS),
        ):
            stack.enter_context(context)
        executor = ThreadPoolExecutor(1, "vision", set_realtime_priority, (VISION,))
        stack.callback(executor.shutdown)
        stack.callback(rig.close)
        progress = stack.enter_context(progress_bar("sweep"))
        return sweep(rig, config, executor=executor, progress=progress)


def _refuse_other_placeholders(path: str) -> None:
    """Refuse placeholders of values that are not found here.

    Raises:
        ConfigError: Names the keys.
    """
    others = [key for key in placeholders(path) if not key.startswith(FOUND_HERE)]
    if others:
        allowed = f"your values, and lines without the word {MARK}"
        raise ConfigError(", ".join(others), f"placeholders of {path}", allowed)


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


def result(found: GeometryFit, *, with_figures: bool = True) -> CalibrationResult:
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
