"""The ticks of the loop on a rig: the only place with a loop and a clock."""

import math
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from functools import partial
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config
from tautscope.errors import SignalError
from tautscope.loop.measurement import Measurement
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.rig import Frame, Rig, Sample, check_sample
from tautscope.loop.safety import Reaction

if TYPE_CHECKING:
    from tautscope.loop.vision import Detection

Floats = NDArray[np.float64]
ImageUpdate = Callable[[HysteresisReduction, Frame], Report]
"""Updates the loop with a frame."""
ImageReports = Iterator[tuple[Frame, Report]]


class Log(Protocol):
    """Receives every event of a run as it happens, e.g. `tautscope.log.writer.LogWriter`."""

    def tick(
        self, sample: Sample, reference: Floats, command: Floats, made_at: float | None = None
    ) -> None:
        """A control tick; `made_at` is when its reference was made [s, the rig's clock]."""

    def frame(self, now: float, frame: Frame, report: Report) -> None:
        """An image update at time `now` [s, the rig's clock]."""

    def measurement(self, now: float, measurement: Measurement, report: Report) -> None:
        """An update by another sensor at time `now` [s, the rig's clock]."""

    def event(self, now: float, what: str) -> None:
        """A call of the operator or the rig, as `HysteresisReduction.on_event`, at time `now`."""


class Monitor(Protocol):
    """Compares motors and tip of a rig, e.g. `tautscope.hardware.plausibility`.

    Its methods raise a `ConfigError` where they disagree.
    """

    def add_sample(self, time: float, applied: Floats) -> None:
        """Add a sample of the rig."""

    def check_frame(self, captured_at: float, report: Report) -> None:
        """Compare an image update with the samples."""


class ControlLoop:
    """Ticks of the loop on a rig, all of them in a log.

    A tick is `control` with the reference, then all `updates`, then `step`. The arguments are as of
    `run_experiment`, and the rig's newest sample, without which the rig is reset. With an executor
    a robot with [[dof]] does not use its images.

    Attributes:
        command: c (n,) [m or rad] of the last tick.

    Raises:
        SignalError: A sample is not as `Sample` says, or the rig's clock does not advance.
        ConfigError: The monitor found that the rig differs from its configuration.
    """

    def __init__(
        self,
        config: Config,
        rig: Rig,
        sample: Sample | None = None,
        *,
        compensate: bool = True,
        look: ImageUpdate = HysteresisReduction.on_frame,
        executor: Executor | None = None,
        monitor: Callable[[Floats], Monitor] | None = None,
    ) -> None:
        self.loop = HysteresisReduction(config, compensate=compensate)
        self._config, self._rig = config, rig
        self._log: Log | None = None
        at_once = partial(_at_once, look)
        self._update = at_once if executor is None else BackgroundUpdater(executor).update
        self._uses_images = executor is None or not config.dof
        self._events: list[tuple[int, str]] = []
        self.sample = check_sample(rig.reset() if sample is None else sample, config)
        self.command = np.array(self.sample.applied, np.float64)
        self._monitor = None if monitor is None else monitor(self.sample.applied)

    def write_to(self, log: Log) -> None:
        """Write all that happens from now on to a log."""
        self._log = log
        # `look` may cause events before and after its update; each is written with its report.
        self.loop.on_event = lambda what: self._events.append((self.loop.updates, what))

    def control(self, reference: ArrayLike, made_at: float | None = None) -> Floats:
        """The command c (n,) [m or rad] for a reference, made at `made_at` [s, the rig's clock]."""
        self.write_events()
        self.command = self.loop.step(reference, self.sample.time, made_at)
        if self._log is not None:
            self._log.tick(self.sample, np.asarray(reference), self.command, made_at)
        if self._monitor is not None:
            self._monitor.add_sample(self.sample.time, self.sample.applied)
        return self.command

    def updates(self) -> Iterator[tuple[Frame | Measurement, Report]]:
        """The updates that have ended, after the command, which never waits for an image."""
        now, image = self.sample.time, self.sample.frame if self._uses_images else None
        for frame, report in self._update(self.loop, image):
            if self._log is not None:
                self.write_events(self.loop.updates)
                self._log.frame(now, frame, report)
            if self._monitor is not None:
                self._monitor.check_frame(frame.captured_at, report)
            yield frame, report
        for measurement in self.sample.measurements:
            report = self.loop.on_sample(measurement)
            if self._log is not None:
                self.write_events(self.loop.updates)
                self._log.measurement(now, measurement, report)
            yield measurement, report

    def step(self) -> None:
        """Send the command and wait for the next sample."""
        before, self.sample = self.sample, check_sample(self._rig.step(self.command), self._config)
        if not self.sample.time > before.time:
            allowed = f"later than the last, {before.time}"
            raise SignalError("sample.time", self.sample.time, allowed)

    def write_events(self, update: float = math.inf) -> None:
        """Write the events before an image update, or all."""
        while self._log is not None and self._events and self._events[0][0] < update:
            self._log.event(self.sample.time, self._events.pop(0)[1])

    @property
    def is_held(self) -> bool:
        """Whether the supervisor holds motion."""
        return self.loop.supervision.reaction.rank >= Reaction.HOLD_MOTION.rank


def _at_once(look: ImageUpdate, loop: HysteresisReduction, frame: Frame | None) -> ImageReports:
    if frame is not None:
        yield frame, look(loop, frame)


class BackgroundUpdater:
    """Detects the markers of one frame at a time in a background thread."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._next: Frame | None = None
        self._running: tuple[Frame, Future[Detection]] | None = None

    def update(self, reduction: HysteresisReduction, frame: Frame | None) -> ImageReports:
        """Updates that have ended since the last call; `frame` is the next one, if it arrived."""
        if self._running is not None and self._running[1].done():
            (detected, result), self._running = self._running, None
            yield detected, reduction.on_detection(detected, result.result())
        self._next = frame or self._next
        if self._next is not None and self._running is None:
            detect = reduction.prepare_detection(self._next)
            self._running, self._next = (self._next, self._executor.submit(detect)), None
