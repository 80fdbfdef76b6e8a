"""One run of the control loop from the console: loop, rig and log, tick by tick."""

from __future__ import annotations

import time
from collections import deque
from concurrent.futures import Executor
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope.config import Config
from tautscope.hardware.plausibility import PlausibilityMonitor
from tautscope.log.writer import LogWriter
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.rig import Frame, Sample
from tautscope.loop.safety import Reaction
from tautscope.runs.experiment import BackgroundUpdater

Floats = NDArray[np.float64]
LATE = 2.0
"""A tick that begins so many control periods after the last one is late."""
_TIMES = 200_000
"""Number of ticks whose times are kept."""


class LiveRig(Protocol):
    """A rig in real time."""

    @property
    def control_period(self) -> float:
        """Time from one command to the next [s]."""
        ...

    def reset(self) -> Sample:
        """Go to the start."""
        ...

    def step(self, command: ArrayLike) -> Sample:
        """Send a command and wait for the end of the control period."""
        ...

    def close(self) -> None:
        """Stop the motors and release all resources."""
        ...


class ReferenceSource(Protocol):
    """Makes the reference of each tick from an operator's input device."""

    @property
    def reference(self) -> Floats:
        """Reference u (3,) [m, rad, rad] of the last tick."""
        ...

    @property
    def age(self) -> float | None:
        """Time from when the reference was made to the last tick [s]; None: made in the tick."""
        ...

    def update(self, now: float, period: float, command: Floats, *, is_held: bool) -> Floats:
        """The reference of a tick, as `tautscope.console.operator_input.OperatorInput.update`."""
        ...


class ControlRun:
    """Ticks of the control loop with the operator's reference, all of them in a log.

    Args:
        config: Settings of the loop.
        rig: A rig after its `reset`.
        sample: Its newest sample.
        operator: The source of the reference.
        path: New file of the log.
        executor: Runs the marker detection.
        monitor: Compares drives and images with the configuration; for a rig.

    Attributes:
        loop: The loop.
        log: Its log.
        path: The file of the log.
        sample: The newest sample.
        reference: u (3,) [m, rad, rad] of the last tick.
        command: c (3,) [m, rad, rad] of the last tick.
        report: The newest image update.
        ticks: Number of ticks.
        late: Number of ticks that were late.
        unused: Number of images that the loop did not use.
        times: Computing time of each tick [s].
    """

    def __init__(
        self,
        config: Config,
        rig: LiveRig,
        sample: Sample,
        operator: ReferenceSource,
        *,
        path: Path,
        executor: Executor,
        monitor: PlausibilityMonitor | None = None,
    ) -> None:
        self.sample = sample
        self.loop = HysteresisReduction(config)
        self.path = path
        self.log = LogWriter(path, config)
        self.loop.on_event = lambda what: self.log.event(self.sample.time, what)
        self._rig, self._operator, self._monitor = rig, operator, monitor
        self._updater = BackgroundUpdater(executor)
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=16)
        self._last_frame: int | None = None
        self._began = 0.0
        self.reference = self.command = operator.reference.copy()
        self.report: Report | None = None
        self.ticks = self.late = self.unused = 0
        self.times: deque[float] = deque(maxlen=_TIMES)

    def tick(self) -> list[tuple[Frame, Report, float]]:
        """Compute the command; the image updates that have ended, with the frames' arrivals.

        Raises:
            ConfigError: The rig differs from its configuration; see `PlausibilityMonitor`.
        """
        began = time.monotonic()
        sample = self.sample
        self.late += self.ticks > 0 and began - self._began > LATE * self._rig.control_period
        self._began = began
        self.reference = self._operator.update(
            began, self._rig.control_period, self.command, is_held=self.is_held
        )
        age = self._operator.age
        made_at = None if age is None else sample.time - age
        self.command = self.loop.step(self.reference, sample.time, made_at)
        self.ticks += 1
        self.times.append(time.monotonic() - began)
        self.log.tick(sample, self.reference, self.command, made_at)
        if self._monitor is not None:
            self._monitor.add_sample(sample.time, sample.applied)
        if sample.frame is not None:
            self._arrivals.append((sample.frame.sequence, began))
        updates = []
        for frame, report in self._updater.update(self.loop, sample.frame):
            self.log.frame(sample.time, frame, report)
            self.report = report
            if self._monitor is not None:
                self._monitor.check_frame(frame.captured_at, report)
            if self._last_frame is not None:
                self.unused += max(frame.sequence - self._last_frame - 1, 0)
            self._last_frame = frame.sequence
            arrived_at = dict(self._arrivals).get(frame.sequence, began)
            updates.append((frame, report, arrived_at))
        return updates

    def step(self) -> None:
        """Send the command and wait for the next sample."""
        self.sample = self._rig.step(self.command)

    @property
    def is_held(self) -> bool:
        """Whether the supervisor holds motion."""
        return self.loop.supervision.reaction.rank >= Reaction.HOLD_MOTION.rank

    def note(self, text: str) -> None:
        """Write a note into the log."""
        self.log.event(self.sample.time, f"note {text}")
