"""A motion of a rig without compensation, as it was commanded and measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.loop.measurement import Measurement
from tautscope.loop.references import Reference
from tautscope.loop.rig import Rig, check_sample


@dataclass(frozen=True, eq=False)
class MotionRecord:
    """Times (ticks,) [s] and commands (ticks, n) [m or rad] of a motion, and what was measured."""

    times: NDArray[np.float64]
    commands: NDArray[np.float64]
    measurements: tuple[Measurement, ...]


def move(
    rig: Rig, motion: Reference, config: Config, progress: Callable[[float], None] | None = None
) -> MotionRecord:
    """Move a rig without compensation: the command is the reference.

    Raises:
        SignalError: A sample is not as `tautscope.Sample` says.
    """
    sample = check_sample(rig.reset(), config)
    start = sample.time
    times: list[float] = []
    commands: list[NDArray[np.float64]] = []
    measurements: list[Measurement] = []
    while (elapsed := sample.time - start) < motion.duration:
        command = motion(elapsed)
        measurements += sample.measurements
        times.append(sample.time)
        commands.append(command)
        sample = check_sample(rig.step(command), config)
        if progress is not None and len(times) % 200 == 0:
            progress(min(elapsed / motion.duration, 1.0))
    return MotionRecord(np.array(times), np.array(commands), tuple(measurements))
