"""The only place with a loop and a clock."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from tautscope.config import Config
from tautscope.errors import SignalError
from tautscope.recording import Recording, Snapshot, Tables, frame_row
from tautscope.reduction import HysteresisReduction, Report
from tautscope.references import Reference
from tautscope.rig import Frame, Rig

if TYPE_CHECKING:
    from tautscope.log.writer import LogWriter

Progress = Callable[[float, float], None]
"""Called about once per second of the rig's clock with (elapsed, duration) [s]."""
Look = Callable[[HysteresisReduction, Frame], Report]
"""An image update: frame in, what became of it out."""


def run_experiment(
    rig: Rig,
    reference: Reference,
    config: Config,
    compensate: bool = True,
    progress: Progress | None = None,
    *,
    look: Look = HysteresisReduction.on_frame,
    log: LogWriter | None = None,
) -> Recording:
    """Run a reference on a rig, with the camera as the only feedback.

    Every control period: reference to command, command to the rig; every image that arrived goes
    to the state estimate and the hysteresis estimators. The rig's truth, if it has one, is
    recorded and never read by the loop.

    Args:
        rig: Any object with the methods of `tautscope.rig.Rig`. It is reset first and left open:
            whoever made it closes it.
        reference: (time [s]) -> (3,) [m, rad, rad], with `duration` and `segments`.
        config: Of the loop.
        compensate: Without, the command is the reference, and the estimators only listen.
        progress: Told how far the run is.
        look: What the loop does with a frame; one that calls `HysteresisReduction.on_features`
            brings a marker detector of your own.
        log: Written while the run goes on, so that it survives whatever ends it; left open.

    Raises:
        SignalError: The reference is not three finite numbers, or the rig's clock does not run.
        FrameError: An image is not what the configured camera gives.
    """
    reduction = HysteresisReduction(config, compensate=compensate)
    recorder = _Recorder(config, reference.duration / 2)
    sample = rig.reset()
    start = sample.time
    while (elapsed := sample.time - start) < reference.duration:
        desired = reference(elapsed)
        command = reduction.step(desired, time=sample.time)
        recorder.tick(sample, desired, command)
        if log is not None:
            log.tick(sample, desired, command)
        # After the command, which never waits for an image.
        if sample.frame is not None:
            report = look(reduction, sample.frame)
            recorder.seen(sample.time, sample.frame, report, elapsed)
            if log is not None:
                log.frame(sample.time, sample.frame, report)
        before, sample = sample, rig.step(command)
        if not sample.time > before.time:
            raise SignalError("sample.time", sample.time, f"later than the last, {before.time}")
        if progress is not None and int(sample.time - start) > int(elapsed):
            progress(sample.time - start, reference.duration)
    trace, frames = recorder.tables()
    segments = tuple(reference.segments)
    return Recording(trace, frames, config, compensate, segments, recorder.snapshot)


class _Recorder(Tables):
    """Keeps one frame of about the middle too."""

    def __init__(self, config: Config, snapshot_after: float) -> None:
        super().__init__(config)
        self.snapshot: Snapshot | None = None
        self._snapshot_after = snapshot_after
        self._is_late = False

    def seen(self, now: float, frame: Frame, report: Report, elapsed: float) -> None:
        self.frame(frame_row(now, frame, report), report.delta_minus, report.delta_plus)
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
