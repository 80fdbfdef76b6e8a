"""A slow motion of insertion and bending, and its images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.images import to_bgr
from tautscope.calibration.rig_motion import move_rig
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import CameraError
from tautscope.loop.rig import Rig

Floats = NDArray[np.float64]
Image = NDArray[np.uint8]

DURATION = 10.0
"""Duration of the motion [s]."""
IMAGES = 40
"""Number of images that are kept."""
_SHARE = (1.0, 0.0, 0.6)
"""Amplitude relative to that of the experiment."""
_TURNS = (1, 1, 2)
"""Periods in the motion."""


@dataclass(frozen=True)
class ImageSequence:
    """Images of a moving instrument.

    Attributes:
        times: (n,) capture times [s].
        positions: (n, 3) positions of the motors then [m, rad, rad].
        images: (n) B, G, R.
    """

    times: Floats
    positions: Floats
    images: list[Image]


def record_motion(
    rig: Rig, config: Config, progress: Callable[[float], None] | None = None
) -> ImageSequence:
    """Move insertion and bending in sines within the range of the experiment, and keep images.

    The motion is supervised as `move_rig` describes; images are not evaluated.

    Args:
        rig: It is reset first; the caller closes it.
        config: Configuration of the rig.
        progress: Called with the share of the motion done, 0 to 1, once per second.

    Raises:
        CameraError: No image arrived.
        MotionHeldError: Motion was held for a second.
        SignalError: The rig's clock does not advance.
        TautscopeError: Errors of the rig.
    """
    ticks: list[tuple[float, Floats]] = []
    frames: list[tuple[float, Image]] = []
    due = 0.0
    for sample in move_rig(rig, config, partial(_reference, config), DURATION, progress):
        ticks.append((sample.time, np.array(sample.applied, np.float64)))
        if sample.frame is not None and sample.time - ticks[0][0] >= due:
            image = to_bgr(sample.frame.image, config.camera.pixel_format).copy()
            frames.append((sample.frame.captured_at, image))
            due += DURATION / IMAGES
    if not frames:
        raise CameraError("camera.source", f"no image in {DURATION:g} s", "images")
    at, applied = (np.array(column) for column in zip(*ticks, strict=True))
    times, images = zip(*frames, strict=True)
    stamps = np.array(times)
    positions = np.column_stack([np.interp(stamps, at, dof) for dof in applied.T])
    return ImageSequence(stamps, positions, list(images))


def _reference(config: Config, elapsed: float) -> Floats:
    """(3,) the centres of the experiment plus sines."""
    phase = 2 * np.pi * elapsed / DURATION
    sines = [config.experiment[dof] for dof in Dof]
    return np.array(
        [
            sine.centre + share * sine.amplitude * np.sin(turns * phase)
            for sine, share, turns in zip(sines, _SHARE, _TURNS, strict=True)
        ]
    )
