"""The calibration motion: all degrees of freedom at once, under the supervision of the loop."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor, Future
from dataclasses import dataclass

import numpy as np

from tautscope.calibration.geometry.recording import Floats, Recorder, Recording
from tautscope.calibration.rig_motion import move_rig
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.loop.rig import Frame, Rig

DURATION = 60.0
"""Duration of the motion [s]."""
_PERIODS = (5.0, 6.1, 4.1)
_SPEED_SHARE = 0.5
_GROWTH_TIME = 2.0


@dataclass(frozen=True)
class SweepReference:
    """Sines of all degrees of freedom at once, with periods that do not repeat within the motion.

    For each DOF, with centre and amplitude a of the experiment,

        u = centre + a min(t / 2 s, 1) sin(2 pi t / T),    2 pi a / T <= reference_speed / 2

    Attributes:
        config: Its `experiment` has centres and amplitudes; the speed is at most half of
            `safety.reference_speed` and of the drives' speed limits.
        duration: [s].
    """

    config: Config
    duration: float = DURATION

    @property
    def periods(self) -> Floats:
        """(3,) periods [s]."""
        config = self.config
        speed = np.array(config.safety.reference_speed)
        if config.drives is not None:
            speed = np.minimum(speed, [config.drives[dof].speed_limit for dof in Dof])
        least = 2 * np.pi * self._amplitudes / (_SPEED_SHARE * speed)
        return np.maximum(_PERIODS, least)

    @property
    def _amplitudes(self) -> Floats:
        return np.array([self.config.experiment[dof].amplitude for dof in Dof])

    def __call__(self, time: float) -> Floats:
        """(3,) [m, rad, rad] at `time` [s from the start]."""
        centre = np.array([self.config.experiment[dof].centre for dof in Dof])
        growth = min(time / _GROWTH_TIME, 1.0)
        return np.asarray(
            centre + growth * self._amplitudes * np.sin(2 * np.pi * time / self.periods)
        )


def sweep(
    rig: Rig,
    config: Config,
    *,
    duration: float = DURATION,
    executor: Executor | None = None,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Move all degrees of freedom of a rig at once, and record motors and images.

    The motion is within the range of `config.experiment`, and supervised as `move_rig` describes.

    Args:
        rig: It is reset first; the caller closes it.
        config: Configuration of the rig.
        duration: [s].
        executor: Searches the bands in the background while control ticks continue; images that
            arrive meanwhile are not used. For a rig that runs in real time.
        progress: Called with the share of the motion done, 0 to 1, once per second.

    Raises:
        MotionHeldError: Motion was held for a second: nobody can re-engage it.
        RecordError: No image arrived.
        SignalError: The rig's clock does not advance.
        FrameError: An image is not what the configured camera gives.
        TautscopeError: Errors of the rig.
    """
    reference = SweepReference(config, duration)
    recorder = Recorder(config)
    images = _ImageQueue(recorder, executor)
    for sample in move_rig(rig, config, reference, duration, progress):
        recorder.add_tick(sample.time, sample.applied)
        if sample.frame is not None:
            images.add(sample.frame)
    images.finish()
    return recorder.recording()


class _ImageQueue:
    """Passes images that are due to a recorder; with an executor, while none is in work."""

    def __init__(self, recorder: Recorder, executor: Executor | None) -> None:
        self._recorder, self._executor = recorder, executor
        self._running: Future[object] | None = None

    def add(self, frame: Frame) -> None:
        if not self._recorder.is_due(frame.captured_at):
            return
        if self._executor is None:
            self._recorder.add_image(frame.image, frame.captured_at)
        elif self._running is None or self._running.done():
            self.finish()
            self._running = self._executor.submit(
                self._recorder.add_image, frame.image, frame.captured_at
            )

    def finish(self) -> None:
        """Wait for the image in work; its error is raised here."""
        if self._running is not None:
            self._running.result()
