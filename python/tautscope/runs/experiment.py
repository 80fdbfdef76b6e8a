"""Runs of a reference on a rig: the only place with a loop and a clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from typing import TYPE_CHECKING, Protocol

import numpy as np

from tautscope.config import Config
from tautscope.errors import MotionHeldError, SignalError
from tautscope.loop.actuators import with_actuators
from tautscope.loop.measurement import Measurement
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import DatedReference, Reference
from tautscope.loop.rig import Frame, Rig, Sample, check_sample
from tautscope.loop.safety import Reaction, Supervision, disabled_monitors
from tautscope.runs.flag_summary import FlagSummary
from tautscope.runs.recording import Floats, Recording, Snapshot
from tautscope.runs.run_recorder import RunRecorder, frame_row, measurement_row

if TYPE_CHECKING:
    from tautscope.loop.vision import Detection

Progress = Callable[[float, float], None]
"""Called about once per second of the rig's clock with (elapsed, duration) [s]."""
ImageUpdate = Callable[[HysteresisReduction, Frame], Report]
"""Updates the loop with a frame."""
HELD_TIME = 1.0
"""How long motion is held before a run ends in which nobody can re-engage it [s]."""
Reports = Iterator[tuple[Frame, Report]]


class Log(Protocol):
    """Receives every event of a run as it happens, e.g. `tautscope.log.writer.LogWriter`."""

    def tick(
        self, sample: Sample, reference: Floats, command: Floats, made_at: float | None = None
    ) -> None:
        """A control tick; `made_at` is when its reference was made [s, the rig's clock]."""
        ...

    def frame(self, now: float, frame: Frame, report: Report) -> None:
        """An image update at time `now` [s, the rig's clock]."""
        ...

    def event(self, now: float, what: str) -> None:
        """A call of the operator or the rig, as `HysteresisReduction.on_event`, at time `now`."""
        ...


def run_experiment(
    rig: Rig,
    reference: Reference,
    config: Config,
    compensate: bool = True,
    progress: Progress | None = None,
    *,
    look: ImageUpdate = HysteresisReduction.on_frame,
    log: Log | None = None,
    executor: Executor | None = None,
    watch: Callable[[Supervision], None] | None = None,
    engage: Callable[[Supervision], bool] | None = None,
) -> Recording:
    """Run a reference on a rig, with the camera, or other sensors of the tip, as the only feedback.

    In every control period the loop turns the reference into a command for the rig. Every image
    or measurement that arrives updates the state estimate and the hysteresis estimators. The rig's
    true state, if it has one, is recorded; the loop never reads it.

    Args:
        rig: Any object with the methods of `tautscope.rig.Rig`. It is reset first; the caller
            closes it.
        reference: (time [s]) -> (n,) [m or rad], with `duration` and `segments`; optionally with
            `made_at` (`tautscope.references.DatedReference`), then an old one causes no motion.
        config: Settings of the loop.
        compensate: If false, the command is the reference; the estimators still run.
        progress: Called with the progress of the run.
        look: The image update; one that calls `HysteresisReduction.on_features` brings your own
            marker detector.
        log: Receives every event at once, so that a crash loses nothing; the caller closes it.
        executor: Runs the marker detection in the background, in place of `look`, while control
            ticks continue; of the frames that arrive meanwhile only the newest is used. For a rig
            that runs in real time.
        watch: Called with the state of the supervisor before each command is sent; an exception
            from it ends the run.
        engage: The operator's decision to re-engage: called in every tick in which motion is held,
            re-engages if it returns True. Without it nobody can, and neither where the loop has to
            be restarted (reaction `disable`): the run then ends after `HELD_TIME`.

    Raises:
        MotionHeldError: Motion was held, and nobody could re-engage it. The error has the recording
            up to this time.
        SignalError: The reference is not n finite numbers, a sample is not as `Sample` says, or the
            rig's clock does not advance.
        FrameError: An image is not what the configured camera gives.
    """
    reduction = HysteresisReduction(config, compensate=compensate)
    recorder = _ExperimentRecorder(config, reference.duration / 2)
    updater = _InlineUpdater(look) if executor is None else BackgroundUpdater(executor)
    events = None if log is None else _EventLog(reduction, log)
    stop = _MotionStop(reduction, engage, rig.control_period)

    def recording() -> Recording:
        if events is not None:
            events.write(sample.time)
        trace, frames = recorder.tables()
        warnings = (
            *disabled_monitors(config),
            *recorder.flags.lines(reduction.supervision.latched),
        )
        segments = tuple(reference.segments)
        return Recording(trace, frames, config, compensate, segments, recorder.snapshot, warnings)

    rig = with_actuators(rig, config)
    dated = reference if isinstance(reference, DatedReference) else None
    sample = check_sample(rig.reset(), config)
    start = sample.time
    while (elapsed := sample.time - start) < reference.duration:
        desired = reference(elapsed)
        made_at = None if dated is None else start + dated.made_at
        if events is not None:
            events.write(sample.time)
        command = reduction.step(desired, time=sample.time, made_at=made_at)
        recorder.add_tick(sample, desired, command)
        if log is not None:
            log.tick(sample, desired, command, made_at)
        # After the command, which never waits for an image.
        for frame, report in updater.update(reduction, sample.frame):
            recorder.add_report(sample.time, frame, report, elapsed)
            if log is not None and events is not None:
                events.write(sample.time, reduction.updates)
                log.frame(sample.time, frame, report)
        for measurement in sample.measurements:
            report = reduction.on_sample(measurement)
            recorder.add_measurement(sample.time, measurement, report, elapsed)
        if watch is not None:
            watch(reduction.supervision)
        if (error := stop.update(sample.time)) is not None:
            error.recording = recording()
            raise error
        before, sample = sample, check_sample(rig.step(command), config)
        if not sample.time > before.time:
            raise SignalError("sample.time", sample.time, f"later than the last, {before.time}")
        if progress is not None and int(sample.time - start) > int(elapsed):
            progress(sample.time - start, reference.duration)
    return recording()


class _MotionStop:
    """Re-engages held motion as `run_experiment` describes, or ends the run."""

    def __init__(
        self,
        loop: HysteresisReduction,
        engage: Callable[[Supervision], bool] | None,
        period: float,
    ) -> None:
        self._loop, self._engage = loop, engage
        self._limit = round(HELD_TIME / period)
        self._ticks = 0
        self._since = 0.0

    def update(self, now: float) -> MotionHeldError | None:
        """The error that ends the run, if there is one, after a tick at time `now` [s]."""
        supervision = self._loop.supervision
        reaction = supervision.reaction
        if reaction.rank < Reaction.HOLD_MOTION.rank:
            self._ticks = 0
            return None
        if self._ticks == 0:
            self._since = now
        # Counted in ticks, because a faulty clock is one of the causes.
        self._ticks += 1
        if self._engage is not None and reaction is not Reaction.DISABLE:
            if self._engage(supervision):
                self._loop.engage()
        elif self._ticks > self._limit:
            return MotionHeldError(self._since, str(reaction), supervision.flags)
        return None


class _InlineUpdater:
    """Updates the loop with each frame at once."""

    def __init__(self, image_update: ImageUpdate) -> None:
        self._image_update = image_update

    def update(self, reduction: HysteresisReduction, frame: Frame | None) -> Reports:
        if frame is not None:
            yield frame, self._image_update(reduction, frame)


class BackgroundUpdater:
    """Detects the markers of one frame at a time in a background thread."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._next: Frame | None = None
        self._running: tuple[Frame, Future[Detection]] | None = None

    def update(self, reduction: HysteresisReduction, frame: Frame | None) -> Reports:
        """Updates that have ended since the last call; `frame` is the next one, if it arrived."""
        if self._running is not None and self._running[1].done():
            (detected, result), self._running = self._running, None
            yield detected, reduction.on_detection(detected, result.result())
        self._next = frame or self._next
        if self._next is not None and self._running is None:
            detect = reduction.prepare_detection(self._next)
            self._running, self._next = (self._next, self._executor.submit(detect)), None


class _EventLog:
    """Writes the events of `HysteresisReduction.on_event` to the log, in their order."""

    def __init__(self, loop: HysteresisReduction, log: Log) -> None:
        self._loop, self._log = loop, log
        self._pending: list[tuple[int, str]] = []
        loop.on_event = self._add

    def write(self, now: float, update: float = math.inf) -> None:
        """Write the events before an image update, or all."""
        while self._pending and self._pending[0][0] < update:
            self._log.event(now, self._pending.pop(0)[1])

    def _add(self, what: str) -> None:
        # `look` may cause events before and after its update; each is written with its report.
        self._pending.append((self._loop.updates, what))


class _ExperimentRecorder(RunRecorder):
    """A run recorder with the flag summary and one valid frame from about the middle."""

    def __init__(self, config: Config, snapshot_after: float) -> None:
        super().__init__(config)
        self.snapshot: Snapshot | None = None
        self.flags = FlagSummary()
        self._snapshot_after = snapshot_after
        self._is_late = False
        self._measurements = 0

    def add_measurement(
        self, now: float, measurement: Measurement, report: Report, elapsed: float
    ) -> None:
        self._measurements += 1
        row = measurement_row(now, self._measurements, measurement, report)
        self.add_frame(row, report.delta_minus, report.delta_plus)
        self.flags.add(elapsed, report.warnings, report.reaction)

    def add_report(self, now: float, frame: Frame, report: Report, elapsed: float) -> None:
        self.add_frame(frame_row(now, frame, report), report.delta_minus, report.delta_plus)
        self.flags.add(elapsed, report.warnings, report.reaction)
        detection = report.detection
        is_late = elapsed >= self._snapshot_after
        if (
            detection is not None
            and detection.valid
            and (self.snapshot is None or (is_late and not self._is_late))
        ):
            self._is_late = is_late
            self.snapshot = Snapshot(
                frame.image.copy(),
                frame.captured_at,
                np.array(detection.features),
                np.array(report.predicted_features),
            )
