"""One run of the control loop from the console: loop, rig and log, tick by tick."""

import time
from collections import deque
from concurrent.futures import Executor
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from tautscope.config import Config
from tautscope.console.uncompensated import MODEL, SECOND_PLANT, ComparedRig, PlayTip, Score
from tautscope.hardware.plausibility import PlausibilityMonitor
from tautscope.hardware.realtime import OTHERS, realtime
from tautscope.hardware.rig import HardwareRig
from tautscope.log.header import header_messages
from tautscope.log.writer import LogWriter
from tautscope.loop.frame_layout import FrameLayout
from tautscope.loop.kinematics import Floats
from tautscope.loop.measurement import Measurement
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.rig import Frame, Rig, Sample
from tautscope.runs.control_loop import ControlLoop

Update = tuple[Frame | Measurement, Report, float]
"""What caused an update of the loop, its result, and when it arrived [s, monotonic clock]."""
LATE = 2.0
"""A tick that begins so many control periods after the last one is late."""
_TIMES = 200_000
"""Number of ticks whose times are kept."""
_KEPT = 200
"""Number of ticks for which the tip without compensation is kept, longer than an image's way."""


def warm_up(config: Config) -> None:
    """Use what is slow at first, the log's messages and the detector, before motors are enabled."""
    header_messages(config, True, (), 0)
    if not config.dof:
        blank = np.zeros(FrameLayout(config.camera).shape, np.uint8)
        HysteresisReduction(config).prepare_detection(Frame(blank, 0.0, 0))()


class ReferenceSource(Protocol):
    """Makes the reference of each tick from an operator's input device."""

    @property
    def reference(self) -> Floats:
        """Reference u (n,) [m or rad] of the last tick."""

    @property
    def age(self) -> float | None:
        """Time from when the reference was made to the last tick [s]; None: made in the tick."""

    def update(self, now: float, period: float, command: Floats, *, is_held: bool) -> Floats:
        """The reference of a tick, as `tautscope.console.operator_input.OperatorInput.update`."""


class ControlRun(ControlLoop):
    """Ticks of the control loop with the operator's reference, all of them in a log.

    The rig has been reset; its `step` waits for the end of the control period.

    Attributes:
        reference: u (n,) [m or rad] of the last tick.
        ticks, late: Number of ticks, and of those that were late.
        unused: Number of images that the loop did not use.
        compensation: Share of the compensation that the operator has chosen.
        times: Computing time of each tick [s].
        uncompensated: Where the tip would be now without compensation (n,) [m or rad].
        uncompensated_by: By what that is known.
    """

    def __init__(
        self,
        config: Config,
        rig: Rig,
        sample: Sample,
        operator: ReferenceSource,
        *,
        path: Path,
        executor: Executor,
    ) -> None:
        monitor = partial(PlausibilityMonitor, config) if isinstance(rig, HardwareRig) else None
        super().__init__(config, rig, sample, executor=executor, monitor=monitor)
        self.path = path
        with realtime(OTHERS):  # of the log's threads, which inherit it
            self.log = LogWriter(path, config)
        self.write_to(self.log)
        self._operator = operator
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=16)
        self._last_frame: int | None = None
        self._began = 0.0
        self.reference = self.command = operator.reference.copy()
        self.report: Report | None = None
        self.ticks = self.late = self.unused = 0
        self.compensation = 1.0
        self.times: deque[float] = deque(maxlen=_TIMES)
        truth = sample.true_state
        self.uncompensated = self.reference if truth is None else np.array(truth, np.float64)
        self._model = PlayTip(self.uncompensated)
        self.uncompensated_by = SECOND_PLANT if isinstance(rig, ComparedRig) else MODEL
        self._uncompensated: deque[tuple[float, Floats]] = deque(maxlen=_KEPT)
        self.score = Score(len(self.reference), rig.control_period)

    @property
    def tip(self) -> Floats:
        """Estimated tip (n,) [m or rad]; NaN where it is not known.

        Between images `paper` has no estimate: its predicted state is the model's alone, and the
        tip is that of the newest image.
        """
        if self._config.profile == "best":
            return self.loop.predicted_state
        if self.report is None:
            return np.full(len(self.reference), np.nan)
        return np.where(self.report.observable, self.report.state_estimate, np.nan)

    def uncompensated_at(self, time: float) -> Floats:
        """Where the tip would have been without compensation at a time [s, the rig's clock]."""
        kept = self._uncompensated
        return next((state for at, state in reversed(kept) if at <= time), self.uncompensated)

    def tick(self) -> list[Update]:
        """Compute the command; the updates that have ended.

        Raises:
            ConfigError: The rig differs from its configuration.
        """
        began, sample, period = time.monotonic(), self.sample, self._rig.control_period
        self.late += self.ticks > 0 and began - self._began > LATE * period
        self._began = began
        self.reference = self._operator.update(began, period, self.command, is_held=self.is_held)
        age = self._operator.age
        self.control(self.reference, None if age is None else sample.time - age)
        self._uncompensated.append((sample.time, self.uncompensated))
        if self.compensation > 0:
            tip = self.tip if sample.true_state is None else np.array(sample.true_state)
            self.score.add(self.reference, tip, self.uncompensated)
        self.ticks += 1
        self.times.append(time.monotonic() - began)
        if sample.frame is not None:
            self._arrivals.append((sample.frame.sequence, began))
        updates: list[Update] = []
        for source, report in self.updates():
            self.report = report
            arrived_at = began
            if isinstance(source, Frame):
                if self._last_frame is not None:
                    self.unused += max(source.sequence - self._last_frame - 1, 0)
                self._last_frame = source.sequence
                arrived_at = dict(self._arrivals).get(source.sequence, began)
            updates.append((source, report, arrived_at))
        self.write_events()
        return updates

    def step(self) -> None:
        """As `ControlLoop.step`, also for the tip without compensation."""
        super().step()
        if isinstance(self._rig, ComparedRig):
            self.uncompensated = self._rig.step_uncompensated(self.reference)
        else:
            offsets = self.loop.delta_minus, self.loop.delta_plus
            self.uncompensated = self._model.step(self.reference, *offsets)

    def set_compensation(self, share: float) -> None:
        """As `HysteresisReduction.set_compensation`."""
        if share != self.compensation:
            self.loop.set_compensation(share)
        self.compensation = share

    def note(self, text: str) -> None:
        """Write a note into the log."""
        self.write_events()
        self.log.event(self.sample.time, f"note {text}")
