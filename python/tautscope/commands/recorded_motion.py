"""Images and motor positions of a log, or of a video with a table, for calibration."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tautscope.config import CameraConfig
from tautscope.errors import RecordError

if TYPE_CHECKING:
    from tautscope.calibration.bands.sweep import ImageSequence

MOST_IMAGES = 60


def log_motion(file: Path) -> ImageSequence:
    """Images of a log, evenly chosen, with the positions that the drives reported.

    Raises:
        MissingPathError, RecordError: As `tautscope.log.reader.read_log`; or it has no images.
    """
    from tautscope.calibration.bands.sweep import ImageSequence  # noqa: PLC0415
    from tautscope.calibration.images import to_bgr  # noqa: PLC0415
    from tautscope.log.reader import Tick, Update, read_log  # noqa: PLC0415
    from tautscope.runs.recording import FRAME_COLUMNS  # noqa: PLC0415

    log = read_log(file)
    ticks = [event.sample for event in log.events.values() if isinstance(event, Tick)]
    updates = [
        (index, event)
        for index, event in log.events.items()
        if isinstance(event, Update) and log.has_image(index)
    ]
    if not ticks or not updates:
        raise RecordError(str(file), f"{len(ticks)} ticks, {len(updates)} images", "both")
    column = (FRAME_COLUMNS.names or ()).index("captured_at")
    chosen = [updates[k] for k in _evenly(len(updates))]
    stamps = np.array([event.row[column] for _, event in chosen])
    at = np.array([tick.time for tick in ticks])
    applied = np.array([tick.applied for tick in ticks])
    positions = np.column_stack([np.interp(stamps, at, dof) for dof in applied.T])
    pixel_format = log.config.camera.pixel_format
    images = [to_bgr(log.image(index), pixel_format) for index, _ in chosen]
    return ImageSequence(stamps, positions, images)


def video_motion(file: Path, motors: Path, start: float, camera: CameraConfig) -> ImageSequence:
    """Images of a video within the time of a table of motor positions, evenly chosen.

    Raises:
        MissingPathError: A file does not exist.
        CameraError: The video cannot be read, or has another size.
        RecordError: As `tautscope.runs.records.read_motors`; or the times do not overlap.
    """
    from tautscope.calibration.bands.sweep import ImageSequence  # noqa: PLC0415
    from tautscope.calibration.images import to_bgr  # noqa: PLC0415
    from tautscope.hardware.video import read_video  # noqa: PLC0415
    from tautscope.runs.records import read_motors  # noqa: PLC0415

    at, applied = read_motors(motors)
    stamps = [
        frame.captured_at
        for frame in read_video(str(file), camera, start)
        if at[0] <= frame.captured_at <= at[-1]
    ]
    if not stamps:
        span = f"frames between {at[0]:g} and {at[-1]:g} s, the time of {motors}"
        raise RecordError("video", "no frame in that time", span)
    chosen = {stamps[k] for k in _evenly(len(stamps))}
    images = [
        to_bgr(frame.image, camera.pixel_format)
        for frame in read_video(str(file), camera, start)
        if frame.captured_at in chosen
    ]
    times = np.array(sorted(chosen))
    positions = np.column_stack([np.interp(times, at, dof) for dof in applied.T])
    return ImageSequence(times, positions, images)


def _evenly(count: int) -> list[int]:
    """At most `MOST_IMAGES` indices, evenly spaced."""
    indices = np.linspace(0, count - 1, min(count, MOST_IMAGES)).round().astype(int)
    return [int(index) for index in dict.fromkeys(indices.tolist())]
