"""Options of the commands that read a video with motor positions."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tautscope.commands import arguments
from tautscope.commands.positions import add_units
from tautscope.commands.printing import progress_bar
from tautscope.config import Config
from tautscope.errors import FieldError
from tautscope.hardware.video import read_video

if TYPE_CHECKING:
    from tautscope.calibration.delay import DelayEstimate

Floats = NDArray[np.float64]


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
        FieldError: There is not.
    """
    if (options.file is None) == (options.video is None):
        given = None if options.file is None else "a log and --video"
        raise FieldError(options.verb, given, "a log, or --video with --motors")
    if (options.video is None) != (options.motors is None):
        raise FieldError("--motors", options.motors, "a file of motor positions and --video")


def align_video_options(
    options: argparse.Namespace, config: Config, motors: tuple[Floats, Floats], limit: float = 5.0
) -> tuple[DelayEstimate, Floats]:
    """Delay of the frames of ``--video``.

    Their stamps begin with ``--video-start``, or with the first time of the motors.

    Returns:
        The estimate, and the stamps of the frames (m,) [s].
    """
    from tautscope.log.alignment import align_video  # noqa: PLC0415

    start = float(motors[0][0]) if options.video_start is None else options.video_start
    frames = read_video(options.video, config.camera, start)
    with progress_bar("delay of the video") as progress:
        return align_video(frames, *motors, config, limit=limit, progress=progress)
