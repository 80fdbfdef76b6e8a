"""Options that read positions of the three DOFs, with a video or from a log."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from tautscope.commands import arguments
from tautscope.commands.printing import progress_bar
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import FieldError, RecordError
from tautscope.hardware.video import read_video
from tautscope.loop.references import RecordedReference
from tautscope.runs.records import read_motors
from tautscope.runs.units import parse_units

if TYPE_CHECKING:
    from tautscope.calibration.delay import DelayEstimate
    from tautscope.calibration.motion import ImageRecorder

Floats = NDArray[np.float64]
Recorder = TypeVar("Recorder", bound="ImageRecorder")

LARGEST_WORKSPACES = 3.0
"""Positions beyond so many workspaces of the experiment are in another unit."""


def add_units(parser: argparse.ArgumentParser) -> None:
    """``--units``."""
    parser.add_argument(
        "--units",
        default="",
        metavar="COL=UNIT,...",
        help="units of these columns: insertion=mm,rotation=deg,bending=deg,time=ms "
        "[those of the titles, else s, m, rad]",
    )


def add_reference(parser: argparse.ArgumentParser, replaces: str) -> None:
    """``--reference`` and ``--units``."""
    parser.add_argument(
        "--reference",
        metavar="FILE",
        help="recorded motion of an operator: CSV or Parquet with columns time, insertion, "
        f"rotation, bending; - reads standard input [{replaces}]",
    )
    add_units(parser)


def read_positions(path: str, units: str, config: Config) -> tuple[Floats, Floats]:
    """Time (n,) [s] and positions (n, 3) [m, rad, rad], see `read_motors`."""
    sines = [config.experiment[dof] for dof in Dof]
    largest = [LARGEST_WORKSPACES * (abs(sine.centre) + sine.amplitude) for sine in sines]
    return read_motors(path, parse_units(units), np.array(largest))


def read_reference(options: argparse.Namespace, config: Config) -> RecordedReference | None:
    """The motion of ``--reference``, within the drives' travel; None without the option.

    Raises:
        FieldError: ``--units`` without ``--reference``.
        RecordError: The file cannot be used, or a position is outside the drives' travel.
    """
    if options.reference is None:
        if options.units:
            raise FieldError(
                "--units", options.units, "a file, --reference FILE, that it describes"
            )
        return None
    time, positions = read_positions(options.reference, options.units, config)
    if len(time) < 2:
        raise RecordError(str(options.reference), f"{len(time)} line", "at least 2")
    if config.drives is not None:
        for dof in Dof:
            lower, upper = config.drives[dof].travel
            farthest = max(positions[:, dof], key=lambda each: max(lower - each, each - upper))
            if not lower <= farthest <= upper:
                where = f"{options.reference}, column {dof.label}"
                allowed = f"{lower:g} to {upper:g}, {dof.key}.travel"
                raise RecordError(where, float(farthest), allowed)
    return RecordedReference(time, positions, config)


def add_video_options(parser: argparse.ArgumentParser, start_help: str) -> None:
    """``FILE.mcap`` or ``--video``, ``--motors``, ``--units``, ``--video-start``."""
    parser.add_argument("file", type=Path, nargs="?", metavar="FILE.mcap")
    parser.add_argument("--video", metavar="FILE", help="video instead of a log; needs --motors")
    parser.add_argument(
        "--motors",
        metavar="FILE",
        help="motor positions: CSV or Parquet with columns time, insertion, rotation, bending; "
        "- reads standard input",
    )
    add_units(parser)
    parser.add_argument("--video-start", type=arguments.seconds, metavar="S", help=start_help)


def check_video_options(options: argparse.Namespace) -> None:
    """Check that there is either a log or a video with motor positions.

    Raises:
        FieldError: There is not, or an option of videos is given with a log.
    """
    if (options.file is None) == (options.video is None):
        given = None if options.file is None else "a log and --video"
        raise FieldError(options.verb, given, "a log, or --video with --motors")
    if (options.video is None) != (options.motors is None):
        raise FieldError("--motors", options.motors, "a file of motor positions and --video")
    if options.video is None and options.units:
        raise FieldError("--units", options.units, "--motors, which it describes, and --video")
    if options.video is None and options.video_start is not None:
        raise FieldError("--video-start", options.video_start, "--video, of which it is the time")


def align_video_options(
    options: argparse.Namespace, config: Config, motors: tuple[Floats, Floats], limit: float = 5.0
) -> tuple[DelayEstimate, Floats]:
    """Delay of the frames of ``--video``, and their stamps (m,) [s].

    These begin with ``--video-start``, or with the first time of the motors.
    """
    from tautscope.log.alignment import align_video  # noqa: PLC0415

    start = float(motors[0][0]) if options.video_start is None else options.video_start
    frames = read_video(options.video, config.camera, start)
    with progress_bar("delay of the video") as progress:
        return align_video(frames, *motors, config, limit=limit, progress=progress)


def add_motor_options(parser: argparse.ArgumentParser) -> None:
    """``--motors``, ``--units`` and ``--video-start``."""
    parser.add_argument(
        "--motors", type=Path, metavar="FILE.csv", help="motor positions of a video"
    )
    add_units(parser)
    parser.add_argument(
        "--video-start",
        type=arguments.seconds,
        default=0.0,
        metavar="S",
        help="time of the video's first frame in the CSV's [s] [%(default)s]",
    )


def check_motor_options(options: argparse.Namespace, file: Path | None) -> None:
    """Check that options of `add_motor_options` belong to a video; `file` may be a log."""
    if file is None or file.suffix == ".mcap":
        arguments.refuse_unused(options, "a video together with --motors", "motors")
    if options.motors is None:
        arguments.refuse_unused(options, "a video with --motors", "video_start", "units")


def read_motion(
    options: argparse.Namespace,
    file: Path,
    make: Callable[[Config], Recorder],
    allowed: str = "a log (.mcap), or a video with --motors",
) -> tuple[Recorder, Config]:
    """Read a log, or a video with ``--motors``, into a recorder; `allowed` is for the error.

    The configuration that is returned has the delay that the stamps are without.
    """
    if file.suffix == ".mcap":
        return _read_log(options, file, make)
    if options.motors is None:
        raise FieldError("file", str(file), allowed)
    config = arguments.article_config(options.config)
    config = config.replace(**{"camera.source.delay": 0.0})  # a video is stamped without it
    recorder = make(config)
    times, positions = read_positions(str(options.motors), options.units, config)
    for time, position in zip(times, positions, strict=True):
        recorder.add_tick(float(time), position)
    for frame in read_video(str(file), config.camera, options.video_start):
        if times[0] <= frame.captured_at <= times[-1] and recorder.is_due(frame.captured_at):
            recorder.add_image(frame.image, frame.captured_at)
    return recorder, config


def _read_log(
    options: argparse.Namespace, file: Path, make: Callable[[Config], Recorder]
) -> tuple[Recorder, Config]:
    from tautscope.log.reader import Tick, Update, read_log  # noqa: PLC0415

    log = read_log(file)
    config = log.config if options.config is None else arguments.article_config(options.config)
    camera = log.config.camera  # of which its images and stamps are
    changes = {"pixel_format": camera.pixel_format, "source.delay": camera.source.delay}
    config = config.replace(**{f"camera.{key}": value for key, value in changes.items()})
    recorder = make(config)
    for index, event in log.events.items():
        if isinstance(event, Tick):
            recorder.add_tick(event.sample.time, event.sample.applied)
        elif isinstance(event, Update) and log.has_image(index):
            captured_at = float(event.row["captured_at"])
            if recorder.is_due(captured_at):
                recorder.add_image(log.image(index), captured_at)
    return recorder, config
