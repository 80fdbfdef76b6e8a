"""The only place with a loop and a clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from typing import TYPE_CHECKING, Protocol

import numpy as np

from tautscope.config import Config
from tautscope.errors import SignalError
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import DatedReference, Reference
from tautscope.loop.rig import Frame, Rig, Sample
from tautscope.loop.safety import Supervision, switched_off
from tautscope.runs.flag_summary import Noticed
from tautscope.runs.recording import Floats, Recording, Snapshot
from tautscope.runs.run_recorder import Tables, frame_row

if TYPE_CHECKING:
    from tautscope.loop.vision import Detection

Progress = Callable[[float, float], None]
"""Called about once per second of the rig's clock with (elapsed, duration) [s]."""
Look = Callable[[HysteresisReduction, Frame], Report]
"""An image update: frame in, what became of it out."""


class Log(Protocol):
    """Told everything as it happens; `tautscope.log.writer.LogWriter` for one."""

    def tick(
        self, sample: Sample, reference: Floats, command: Floats, made_at: float | None = None
    ) -> None:
        """A control tick; when its reference was made [s, the rig's clock], if that is known."""
        ...

    def frame(self, now: float, frame: Frame, report: Report) -> None:
        """An image update, at a time of the rig's clock [s]."""
        ...

    def event(self, now: float, what: str) -> None:
        """What the operator or the rig told the loop, `HysteresisReduction.on_event`, likewise."""
        ...


def run_experiment(
    rig: Rig,
    reference: Reference,
    config: Config,
    compensate: bool = True,
    progress: Progress | None = None,
    *,
    look: Look = HysteresisReduction.on_frame,
    log: Log | None = None,
    aside: Executor | None = None,
    watch: Callable[[Supervision], None] | None = None,
) -> Recording:
    """Run a reference on a rig, with the camera as the only feedback.

    Every control period: reference to command, command to the rig; every image that arrived goes
    to the state estimate and the hysteresis estimators. The rig's truth, if it has one, is
    recorded and never read by the loop.

    Args:
        rig: Any object with the methods of `tautscope.rig.Rig`. It is reset first and left open:
            whoever made it closes it.
        reference: (time [s]) -> (3,) [m, rad, rad], with `duration` and `segments`; with `made_at`
            too, one that is old moves nothing (`tautscope.loop.references.DatedReference`).
        config: Of the loop.
        compensate: Without, the command is the reference, and the estimators only listen.
        progress: Told how far the run is.
        look: What the loop does with a frame; one that calls `HysteresisReduction.on_features`
            brings a marker detector of your own.
        log: Written while the run goes on, so that it survives whatever ends it; left open.
        aside: Looks at the images, in place of `look`, while ticks go on; of frames that come
            meanwhile, the newest is next. For a rig whose time does not wait.
        watch: Told how the loop stands before each command is sent; what it raises ends the run.

    Raises:
        SignalError: The reference is not three finite numbers, or the rig's clock does not run.
        FrameError: An image is not what the configured camera gives.
    """
    reduction = HysteresisReduction(config, compensate=compensate)
    recorder = _Recorder(config, reference.duration / 2)
    eyes = _Ahead(look) if aside is None else _Aside(aside)
    events = None if log is None else _Events(reduction, log)
    sample = rig.reset()
    start = sample.time
    while (elapsed := sample.time - start) < reference.duration:
        desired = reference(elapsed)
        made_at = start + reference.made_at if isinstance(reference, DatedReference) else None
        if events is not None:
            events.write(sample.time)
        command = reduction.step(desired, time=sample.time, made_at=made_at)
        recorder.tick(sample, desired, command)
        if log is not None:
            log.tick(sample, desired, command, made_at)
        # After the command, which never waits for an image.
        for frame, report in eyes.see(reduction, sample.frame):
            recorder.seen(sample.time, frame, report, elapsed)
            if log is not None and events is not None:
                events.write(sample.time, reduction.updates)
                log.frame(sample.time, frame, report)
        if watch is not None:
            watch(reduction.supervision)
        before, sample = sample, rig.step(command)
        if not sample.time > before.time:
            raise SignalError("sample.time", sample.time, f"later than the last, {before.time}")
        if progress is not None and int(sample.time - start) > int(elapsed):
            progress(sample.time - start, reference.duration)
    if events is not None:
        events.write(sample.time)
    trace, frames = recorder.tables()
    segments = tuple(reference.segments)
    warnings = (*switched_off(config), *recorder.noticed.lines(reduction.supervision.latched))
    return Recording(trace, frames, config, compensate, segments, recorder.snapshot, warnings)


Seen = Iterator[tuple[Frame, Report]]


class _Ahead:
    """Looks at a frame before anything else happens."""

    def __init__(self, look: Look) -> None:
        self._look = look

    def see(self, reduction: HysteresisReduction, frame: Frame | None) -> Seen:
        if frame is not None:
            yield frame, self._look(reduction, frame)


class _Aside:
    """Has one frame looked at by another thread; its answer is taken in when it is there."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._next: Frame | None = None
        self._asked: tuple[Frame, Future[Detection]] | None = None

    def see(self, reduction: HysteresisReduction, frame: Frame | None) -> Seen:
        if self._asked is not None and self._asked[1].done():
            (seen, answer), self._asked = self._asked, None
            yield seen, reduction.on_detection(seen, answer.result())
        self._next = frame or self._next
        if self._next is not None and self._asked is None:
            question = reduction.question(self._next)
            self._asked, self._next = (self._next, self._executor.submit(question)), None


class _Events:
    """What the loop is told beside references and images, for the log, in the order it was told."""

    def __init__(self, loop: HysteresisReduction, log: Log) -> None:
        self._loop, self._log = loop, log
        self._waiting: list[tuple[int, str]] = []
        loop.on_event = self._note

    def write(self, now: float, update: float = math.inf) -> None:
        """Those before an image update, or all."""
        while self._waiting and self._waiting[0][0] < update:
            self._log.event(now, self._waiting.pop(0)[1])

    def _note(self, what: str) -> None:
        # `look` may tell it something before and after its image: one is written with its report.
        self._waiting.append((self._loop.updates, what))


class _Recorder(Tables):
    """Keeps one frame of about the middle too."""

    def __init__(self, config: Config, snapshot_after: float) -> None:
        super().__init__(config)
        self.snapshot: Snapshot | None = None
        self.noticed = Noticed()
        self._snapshot_after = snapshot_after
        self._is_late = False

    def seen(self, now: float, frame: Frame, report: Report, elapsed: float) -> None:
        self.frame(frame_row(now, frame, report), report.delta_minus, report.delta_plus)
        self.noticed.image(elapsed, report)
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
