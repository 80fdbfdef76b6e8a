"""Runs of a reference on a rig."""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np

from tautscope.config import Config
from tautscope.errors import MotionHeldError, SignalError
from tautscope.loop.actuators import with_actuators
from tautscope.loop.measurement import Measurement
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import Reference, Segment
from tautscope.loop.rig import Frame, Rig
from tautscope.loop.safety import Reaction, Supervision, disabled_monitors
from tautscope.loop.signal_checks import check_time
from tautscope.runs.control_loop import ControlLoop, Floats, ImageUpdate, Log, Monitor
from tautscope.runs.flag_summary import FlagSummary
from tautscope.runs.recording import Recording, Snapshot
from tautscope.runs.run_recorder import RunRecorder

Progress = Callable[[float, float], None]
"""Called about once per second of the rig's clock with (elapsed, duration) [s]."""
Engage = Callable[[Supervision], bool]
"""Whether held motion is to be re-engaged."""
HELD_TIME = 1.0
"""How long motion is held before a run ends in which nobody can re-engage it [s]."""


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
    engage: Engage | None = None,
    monitor: Callable[[Floats], Monitor] | None = None,
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
        monitor: Makes a monitor of the rig from its motors (n,) at the start.

    Raises:
        MotionHeldError: Motion was held, and nobody could re-engage it. The error has the recording
            up to this time.
        SignalError: The reference is not n finite numbers, or its `duration`, `segments` or
            `made_at` are not as described; a sample is not as `Sample` says, or the rig's clock
            does not advance.
        FrameError: An image is not what the configured camera gives.
    """
    rig = with_actuators(rig, config)
    _check_reference(reference)
    ticks = ControlLoop(
        config, rig, compensate=compensate, look=look, executor=executor, monitor=monitor
    )
    if log is not None:
        ticks.write_to(log)
    recorder = _ExperimentRecorder(config, reference.duration / 2)
    stop = _MotionStop(ticks.loop, engage, rig.control_period)

    def recording() -> Recording:
        ticks.write_events()
        trace, frames = recorder.tables()
        flags = recorder.flags.lines(ticks.loop.supervision.latched)
        warnings, segments = (*disabled_monitors(config), *flags), tuple(reference.segments)
        return Recording(trace, frames, config, compensate, segments, recorder.snapshot, warnings)

    start = ticks.sample.time
    while (elapsed := ticks.sample.time - start) < reference.duration:
        desired = reference(elapsed)
        made = getattr(reference, "made_at", None)
        made_at = None if made is None else start + check_time("reference.made_at", made)
        command = ticks.control(desired, made_at)
        recorder.add_tick(ticks.sample, desired, command)
        for source, report in ticks.updates():
            recorder.add_report(ticks.sample.time, source, report, elapsed)
        supervision = ticks.loop.supervision
        recorder.flags.add_tick(elapsed, supervision.flags, supervision.reaction)
        if watch is not None:
            watch(supervision)
        if (error := stop.update(ticks.sample.time)) is not None:
            error.recording = recording()
            raise error
        ticks.step()
        now = ticks.sample.time - start
        if progress is not None and int(now) > int(elapsed):
            progress(now, reference.duration)
    return recording()


def _check_reference(reference: Reference) -> None:
    """Check what is read when a run ends, before its motors move."""
    duration: Any = getattr(reference, "duration", None)
    if not isinstance(duration, int | float | np.number) or not duration > 0.0:
        raise SignalError("reference.duration", duration, "a time above 0 s, or inf")
    segments = getattr(reference, "segments", None)
    if not isinstance(segments, Sequence) or not all(isinstance(s, Segment) for s in segments):
        allowed = "a sequence of tautscope.references.Segment, which may be empty: ()"
        raise SignalError("reference.segments", segments, allowed)


class _MotionStop:
    """Re-engages held motion as `run_experiment` describes, or ends the run."""

    def __init__(self, loop: HysteresisReduction, engage: Engage | None, period: float) -> None:
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


class _ExperimentRecorder(RunRecorder):
    """A run recorder with the flag summary and one valid frame from about the middle."""

    def __init__(self, config: Config, snapshot_after: float) -> None:
        super().__init__(config)
        self.snapshot: Snapshot | None = None
        self.flags = FlagSummary(config)
        self._snapshot_after = snapshot_after
        self._is_late = False
        self._measurements = 0

    def add_report(
        self, now: float, source: Frame | Measurement, report: Report, elapsed: float
    ) -> None:
        self._measurements += not isinstance(source, Frame)
        self.add_update(now, source, report, self._measurements)
        self.flags.add(elapsed, report.warnings, report.reaction)
        detection, is_late = report.detection, elapsed >= self._snapshot_after
        if not isinstance(source, Frame) or detection is None or not detection.valid:
            return
        if self.snapshot is None or (is_late and not self._is_late):
            self._is_late = is_late
            self.snapshot = Snapshot(
                source.image.copy(),
                source.captured_at,
                np.array(detection.features),
                np.array(report.predicted_features),
            )
