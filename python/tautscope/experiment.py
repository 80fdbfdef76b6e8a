"""The only place with a loop and a clock."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import SignalError
from tautscope.recording import (
    FRAME_COLUMNS,
    TRACE_COLUMNS,
    Recording,
    Snapshot,
    Table,
    per_dof,
)
from tautscope.reduction import HysteresisReduction, Report
from tautscope.references import Reference
from tautscope.rig import Frame, Rig, Sample

Floats = NDArray[np.float64]
Progress = Callable[[float, float], None]
"""Called about once per second of the rig's clock with (elapsed, duration) [s]."""
Look = Callable[[HysteresisReduction, Frame], Report]
"""An image update: frame in, what became of it out."""

_UNKNOWN = (np.nan, np.nan, np.nan)
_NO_FEATURES = (np.nan, np.nan, np.nan, np.nan)


def run_experiment(
    rig: Rig,
    reference: Reference,
    config: Config,
    compensate: bool = True,
    progress: Progress | None = None,
    *,
    look: Look = HysteresisReduction.on_frame,
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
        # After the command, which never waits for an image.
        if sample.frame is not None:
            report = look(reduction, sample.frame)
            recorder.frame(sample.time, sample.frame, report, elapsed)
        before, sample = sample, rig.step(command)
        if not sample.time > before.time:
            raise SignalError("sample.time", sample.time, f"later than the last, {before.time}")
        if progress is not None and int(sample.time - start) > int(elapsed):
            progress(sample.time - start, reference.duration)
    trace, frames = recorder.tables()
    segments = tuple(reference.segments)
    return Recording(trace, frames, config, compensate, segments, recorder.snapshot)


class _Recorder:
    """Collects the rows of a `Recording`."""

    def __init__(self, config: Config, snapshot_after: float) -> None:
        self.snapshot: Snapshot | None = None
        self._snapshot_after = snapshot_after
        self._is_late = False
        self._trace: list[tuple[object, ...]] = []
        self._frames: list[tuple[object, ...]] = []
        deltas = [
            *(config[dof].delta_minus for dof in Dof),
            *(config[dof].delta_plus for dof in Dof),
        ]
        self._estimate: tuple[float, ...] = _UNKNOWN
        self._deltas: tuple[float, ...] = tuple(deltas)
        self._status = "none"

    def tick(self, sample: Sample, desired: Floats, command: Floats) -> None:
        truth = _UNKNOWN if sample.true_state is None else sample.true_state
        self._trace.append(
            (
                sample.time,
                *desired,
                *command,
                *sample.applied,
                *self._estimate,
                *truth,
                *self._deltas,
                self._status,
            )
        )

    def frame(self, now: float, frame: Frame, report: Report, elapsed: float) -> None:
        self._estimate = tuple(report.state_estimate)
        self._deltas = (*report.delta_minus, *report.delta_plus)
        self._status = str(report.status)
        detection = report.detection
        valid = detection is not None and bool(detection.valid)
        features = detection.features if detection is not None and valid else _NO_FEATURES
        truth = _NO_FEATURES if frame.true_features is None else frame.true_features
        self._frames.append(
            (
                frame.captured_at,
                now,
                frame.sequence,
                self._status,
                valid,
                *report.state_estimate,
                *report.predicted_state,
                *_UNKNOWN,
                *report.observable,
                *features,
                *report.predicted_features,
                *report.innovation,
                *truth,
            )
        )
        is_late = elapsed >= self._snapshot_after
        if valid and (self.snapshot is None or (is_late and not self._is_late)):
            self._is_late = is_late
            self.snapshot = Snapshot(
                frame.image.copy(),
                frame.captured_at,
                np.array(features),
                np.array(report.predicted_features),
            )

    def tables(self) -> tuple[Table, Table]:
        trace = np.array(self._trace, dtype=TRACE_COLUMNS)
        frames = np.array(self._frames, dtype=FRAME_COLUMNS)
        for dof, truth in zip(Dof, per_dof(trace, "true").T, strict=True):
            frames[f"true_{dof.label}"] = np.interp(
                frames["captured_at"], trace["time"], truth, left=np.nan, right=np.nan
            )
        return trace, frames
