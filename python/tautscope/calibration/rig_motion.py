"""Motion of a rig without compensation, under the supervision of the loop."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.errors import MotionHeldError, SignalError
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.rig import Rig, Sample
from tautscope.loop.safety import Reaction

_HELD_TIME = 1.0
_IMAGE_DETECTORS = (
    "frozen",
    "late",
    "duplicate",
    "innovation",
    "swapped",
    "merged",
    "lost",
    "unobservable",
    "overcompensation",
    "slack_changed",
    "geometry_off",
    "width_limit",
)


def move_rig(
    rig: Rig,
    config: Config,
    reference: Callable[[float], NDArray[np.float64]],
    duration: float,
    progress: Callable[[float], None] | None = None,
) -> Iterator[Sample]:
    """Move a rig by a reference; yields the sample of each control period before the next motion.

    Gate, limits of travel and speed, monitors of tick and camera and the rig's own protections are
    those of an experiment. Images update no estimate, and the detectors that compare images with
    the configured geometry are off, because a calibration does not know it: the command is the
    reference.

    Args:
        rig: It is reset first; the caller closes it.
        config: Configuration of the rig.
        reference: (3,) [m, rad, rad] at a time [s from the start].
        duration: [s].
        progress: Called with the share of the motion done, 0 to 1, once per second.

    Raises:
        MotionHeldError: Motion was held for a second: nobody can re-engage it.
        SignalError: The rig's clock does not advance.
        TautscopeError: Errors of the rig.
    """
    off = tuple(dict.fromkeys([*config.safety.off, *_IMAGE_DETECTORS]))
    loop = HysteresisReduction(config.replace(**{"safety.off": off}), compensate=False)
    sample = rig.reset()
    start, held = sample.time, 0
    while (elapsed := sample.time - start) < duration:
        command = loop.step(reference(elapsed), time=sample.time)
        yield sample
        if sample.frame is not None:
            # Only its arrival counts: its stamp may be wrong by the delay that is to be found.
            loop.on_features(None, sample.time)
        held = held + 1 if loop.supervision.reaction.rank >= Reaction.HOLD_MOTION.rank else 0
        if held * rig.control_period > _HELD_TIME:
            now = loop.supervision
            raise MotionHeldError(sample.time, str(now.reaction), now.flags)
        before, sample = sample, rig.step(command)
        if not sample.time > before.time:
            raise SignalError("sample.time", sample.time, f"later than the last, {before.time}")
        if progress is not None and int(sample.time - start) > int(elapsed):
            progress(min((sample.time - start) / duration, 1.0))
