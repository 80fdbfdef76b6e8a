"""A slow motion of insertion and bending, and its images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tautscope.calibration.geometry.sweep import OF_IMAGES
from tautscope.calibration.images import to_bgr
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import CameraError, MotionHeldError, SignalError
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.rig import Rig
from tautscope.loop.safety import Reaction

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
_HELD_TIME = 1.0


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

    Gate and limits of the loop supervise the motion; images are not evaluated.

    Args:
        rig: It is reset first; the caller closes it.
        config: Configuration of the rig.
        progress: Called with the share of the motion done.

    Raises:
        CameraError: No image arrived.
        MotionHeldError: Motion was held for a second.
        SignalError: The rig's clock does not advance.
        TautscopeError: Errors of the rig.
    """
    off = tuple(dict.fromkeys([*config.safety.off, *OF_IMAGES]))
    loop = HysteresisReduction(config.replace(**{"safety.off": off}), compensate=False)
    ticks: list[tuple[float, Floats]] = []
    frames: list[tuple[float, Image]] = []
    sample = rig.reset()
    start, held, due = sample.time, 0, 0.0
    while (elapsed := sample.time - start) < DURATION:
        command = loop.step(_reference(config, elapsed), time=sample.time)
        ticks.append((sample.time, np.array(sample.applied, np.float64)))
        if sample.frame is not None:
            loop.on_features(None, sample.time)
            if elapsed >= due:
                image = to_bgr(sample.frame.image, config.camera.pixel_format).copy()
                frames.append((sample.frame.captured_at, image))
                due += DURATION / IMAGES
        held = held + 1 if loop.supervision.reaction.rank >= Reaction.HOLD_MOTION.rank else 0
        if held * rig.control_period > _HELD_TIME:
            now = loop.supervision
            raise MotionHeldError(sample.time, str(now.reaction), now.flags)
        before, sample = sample, rig.step(command)
        if not sample.time > before.time:
            raise SignalError("sample.time", sample.time, f"later than the last, {before.time}")
        if progress is not None:
            progress(min((sample.time - start) / DURATION, 1.0))
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
