"""Images and motor positions of a log, or of a video with a table, for calibration."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from tautscope.commands import arguments
from tautscope.config import Config
from tautscope.errors import FieldError
from tautscope.hardware.video import read_video
from tautscope.runs.records import read_motors

if TYPE_CHECKING:
    from tautscope.calibration.motion import ImageRecorder

Recorder = TypeVar("Recorder", bound="ImageRecorder")


def add_motor_options(parser: argparse.ArgumentParser) -> None:
    """``--motors`` and ``--video-start``."""
    parser.add_argument(
        "--motors", type=Path, metavar="FILE.csv", help="motor positions of a video"
    )
    parser.add_argument(
        "--video-start",
        type=arguments.seconds,
        default=0.0,
        metavar="S",
        help="time of the video's first frame in the CSV's [s] [%(default)s]",
    )


def check_motor_options(options: argparse.Namespace, file: Path | None) -> None:
    """Check that ``--motors`` and ``--video-start`` belong to a video.

    Args:
        options: With those of `add_motor_options`.
        file: A log or a video; None without a record.

    Raises:
        FieldError: They have no effect.
    """
    if file is None or file.suffix == ".mcap":
        arguments.refuse_unused(options, "a video together with --motors", "motors")
    if options.motors is None:
        arguments.refuse_unused(options, "a video with --motors", "video_start")


def read_motion(
    options: argparse.Namespace,
    file: Path,
    make: Callable[[Config], Recorder],
    allowed: str = "a log (.mcap), or a video with --motors",
) -> tuple[Recorder, Config]:
    """Read a log, or a video with ``--motors``, into a recorder.

    Raises:
        FieldError: The file is a video without positions; `allowed` is what the command reads.
        MissingPathError, RecordError, CameraError: A file is missing or cannot be read.
    """
    if file.suffix == ".mcap":
        return _read_log(options, file, make)
    if options.motors is None:
        raise FieldError("file", str(file), allowed)
    config = arguments.article_config(options.config)
    recorder = make(config)
    times, positions = read_motors(options.motors)
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
    config = config.replace(**{"camera.pixel_format": log.config.camera.pixel_format})
    recorder = make(config)
    for index, event in log.events.items():
        if isinstance(event, Tick):
            recorder.add_tick(event.sample.time, event.sample.applied)
        elif isinstance(event, Update) and log.has_image(index):
            captured_at = float(event.row["captured_at"])
            if recorder.is_due(captured_at):
                recorder.add_image(log.image(index), captured_at)
    return recorder, config
