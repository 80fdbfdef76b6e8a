"""Motions of a calibration without compensation: references, supervision and records."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from itertools import chain
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import ConfigError, MotionHeldError, RecordError, SignalError
from tautscope.loop.actuators import with_actuators
from tautscope.loop.kinematics import Floats
from tautscope.loop.measurement import Measurement
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.references import Reference, Segment
from tautscope.loop.rig import Rig, Sample, check_sample
from tautscope.loop.safety import Reaction

Progress = Callable[[float], None]
"""Called with the share of the motion done, 0 to 1, once per second."""
DURATION = 60.0
"""Duration of a sweep [s]."""
SHARE = 0.4
"""Amplitude about the middle of a range [share of the range]."""
_PERIODS = (5.0, 6.1, 4.1)
_LONGEST, _RATIO = 9.0, 0.875
_SPEED_SHARE = 0.5
_START_TIME = 2.0
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
    "frame_rate",
    "width_limit",
)


@dataclass(frozen=True, eq=False)
class Sines:
    """Sines of all degrees of freedom at once; arrays (n,) [m or rad], periods [s].

    u = centre + amplitude sin(2 pi s / T),    s = t^2 / 4 s until 2 s, then t - 1 s

    The motion starts at rest, and is never faster than its sines.
    """

    centre: Floats
    amplitude: Floats
    periods: Floats
    duration: float
    segments: ClassVar[Sequence[Segment]] = ()

    def __call__(self, time: float) -> Floats:
        """Reference (n,) [m or rad] at a time [s from the start]."""
        start = min(time, _START_TIME)
        phases = 2 * np.pi * (time - start + start**2 / (2 * _START_TIME)) / self.periods
        return np.asarray(self.centre + self.amplitude * np.sin(phases))


def article_sines(config: Config) -> tuple[Floats, Floats]:
    """Centres and amplitudes (3,) of the experiment [m, rad, rad]."""
    sines = [config.experiment[dof] for dof in Dof]
    return np.array([each.centre for each in sines]), np.array([each.amplitude for each in sines])


def feasible_periods(config: Config, amplitude: Floats, periods: Floats) -> Floats:
    """Periods (n,) [s] of sines of amplitudes (n,), longer where they are too fast.

    That is where the speed would exceed half of `safety.reference_speed` and of the drives' limits,
    or of `dof.speed`.
    """
    speed = np.array([each.speed or 2 * each.width_limit for each in config.dof])
    if not config.dof:
        speed = np.array(config.safety.reference_speed)
        if config.drives is not None:
            speed = np.minimum(speed, [config.drives[dof].speed_limit for dof in Dof])
    return np.maximum(periods, 2 * np.pi * amplitude / (_SPEED_SHARE * speed))


def sweep_motion(config: Config, duration: float = DURATION) -> Sines:
    """The motion that calibrates a rig: sines with periods that do not repeat within it.

    Centres and amplitudes are those of the experiment; of degrees of freedom in [[dof]] the middle
    of their range and 0.4 of it. Periods are those of `feasible_periods`.

    Raises:
        ConfigError: A degree of freedom has no range.
    """
    if not config.dof:
        centre, amplitude = article_sines(config)
        periods = np.array(_PERIODS)
    else:
        for index, each in enumerate(config.dof):
            if each.range is None:
                allowed = "a range, within which the motors move"
                raise ConfigError(f"dof[{index}].range", None, allowed)
        low, high = np.array([each.range for each in config.dof], dtype=np.float64).T
        centre, amplitude = (low + high) / 2, SHARE * (high - low)
        periods = _LONGEST * _RATIO ** np.arange(len(config.dof))
    return Sines(centre, amplitude, feasible_periods(config, amplitude, periods), duration)


def move_rig(
    rig: Rig, config: Config, motion: Reference, progress: Progress | None = None
) -> Iterator[tuple[Sample, Floats]]:
    """Move a rig; yields the sample of each control period, and the command that follows it.

    Gate, limits of travel and speed, monitors of tick and camera and the rig's own protections are
    those of an experiment. Measurements update no estimate, and the detectors that compare them
    with the configured geometry are off, because a calibration does not know it: the command is
    the reference.

    The rig is reset first; the caller closes it.

    Raises:
        MotionHeldError: Motion was held for a second: nobody can re-engage it.
        SignalError: The rig's clock does not advance, or a sample is not as `Sample` says.
    """
    off = tuple(dict.fromkeys([*config.safety.off, *_IMAGE_DETECTORS]))
    loop = HysteresisReduction(config.replace(**{"safety.off": off}), compensate=False)
    rig = with_actuators(rig, config)
    sample = check_sample(rig.reset(), config)
    start, held = sample.time, 0
    while (elapsed := sample.time - start) < motion.duration:
        command = loop.step(motion(elapsed), time=sample.time)
        yield sample, command
        if sample.frame is not None and not config.dof:
            # Only its arrival counts: its stamp may be wrong by the delay that is to be found.
            loop.on_features(None, sample.time)
        held = held + 1 if loop.supervision.reaction.rank >= Reaction.HOLD_MOTION.rank else 0
        if held * rig.control_period > _HELD_TIME:
            now = loop.supervision
            raise MotionHeldError(sample.time, str(now.reaction), now.flags)
        before, sample = sample, check_sample(rig.step(command), config)
        if not sample.time > before.time:
            raise SignalError("sample.time", sample.time, f"later than the last, {before.time}")
        if progress is not None and int(sample.time - start) > int(elapsed):
            progress(min((sample.time - start) / motion.duration, 1.0))


@dataclass(frozen=True, eq=False)
class MotionRecord:
    """Times (ticks,) [s] and commands (ticks, n) [m or rad] of a motion, and what was measured."""

    times: Floats
    commands: Floats
    measurements: tuple[Measurement, ...]


def move(
    rig: Rig, motion: Reference, config: Config, progress: Progress | None = None
) -> MotionRecord:
    """Move a rig as `move_rig` does, and record what its sensors measure."""
    ticks = [
        (sample.time, command, sample.measurements)
        for sample, command in move_rig(rig, config, motion, progress)
    ]
    times, commands, measurements = zip(*ticks, strict=True)
    return MotionRecord(np.array(times), np.array(commands), tuple(chain(*measurements)))


class ImageRecorder(ABC):
    """Collects positions of the motors, and of the images those that are due.

    Args:
        period: Least time between two images that are used [s].
        executor: Evaluates the images in the background while control ticks continue; those that
            arrive meanwhile are not used. For a rig that runs in real time.
    """

    def __init__(self, period: float, executor: Executor | None = None) -> None:
        self.ticks: list[tuple[float, Floats]] = []
        self.period = period
        self._due, self._executor = -np.inf, executor
        self._running: Future[object] | None = None

    @abstractmethod
    def add_image(self, image: NDArray[np.uint8], captured_at: float) -> object:
        """Use an image that is due, and call `used`."""

    def add_tick(self, time: float, motors: Floats) -> None:
        """Add the positions (3,) of the drives at a time."""
        self.ticks.append((time, np.array(motors, dtype=np.float64)))

    def is_due(self, captured_at: float) -> bool:
        """Whether an image of this capture time is needed."""
        return captured_at >= self._due

    def used(self, captured_at: float) -> None:
        """Note the time of an image, after which the next is due."""
        self._due = captured_at + self.period - 1e-9

    def check_is_complete(self, images: int) -> None:
        """Check that there are positions, and `images` that were kept.

        Raises:
            RecordError: There is no motor position or no image.
        """
        if not self.ticks or not images:
            found = f"{len(self.ticks)} motor positions and {images} images"
            raise RecordError("recording", found, "both, of the same motion")

    def move(self, rig: Rig, config: Config, motion: Reference, progress: Progress | None) -> None:
        """Move a rig as `move_rig` does, and collect motors and images."""
        for sample, _ in move_rig(rig, config, motion, progress):
            self.add_tick(sample.time, sample.applied)
            if (frame := sample.frame) is None or not self.is_due(frame.captured_at):
                continue
            image = frame.image, frame.captured_at
            if self._executor is None:
                self.add_image(*image)
            elif self._running is None or self._running.done():
                self._wait()
                self._running = self._executor.submit(self.add_image, *image)
        self._wait()

    def _wait(self) -> None:
        """Wait for the image in work; its error is raised here."""
        if self._running is not None:
            self._running.result()
