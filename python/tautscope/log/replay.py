"""Replay of a recorded run.

`replay_same` repeats a run with its own configuration; the outputs must be identical to the bit.
`estimate_from_log` and `estimate_from_video` run the estimators of another configuration on
recorded commands and images. They do not show how the instrument would have moved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tautscope.calibration.delay import DelayEstimate
from tautscope.config import Config
from tautscope.errors import ConfigError, RecordError
from tautscope.log import messages as msg
from tautscope.log.reader import Log, Request, Tick, Update
from tautscope.loop.measurement import Measurement
from tautscope.loop.reduction import HysteresisReduction, Report
from tautscope.loop.references import Segment
from tautscope.loop.rig import Frame, Sample
from tautscope.loop.safety import DETECTORS
from tautscope.runs.recording import FEATURES, Floats, Recording
from tautscope.runs.run_recorder import RunRecorder

if TYPE_CHECKING:
    from tautscope.loop.vision import Detection

_WITH_TICK = "a log with a tick before the first missing message"
# Commands were executed already and may be faster than an operator; codecs repeat frames.
_IGNORED = ("reference_jump", "reference_fast", "reference_late", "late_tick", "monitor", "frozen")
PREPARE = "prepare_detection "
"""Begin of the request to prepare the detection of a frame, before its sequence number."""
SeenFrame = tuple[float, Frame, int]
Seen = SeenFrame | tuple[float, Measurement, int]
"""Arrival time [s] of what an update saw, this, and its sequence number."""
Inputs = Iterator[Tick | Seen]
"""Ticks, and frames or measurements, in the order of the run."""


@dataclass(slots=True)
class Comparison:
    """Comparison of a replay with its log, bit for bit.

    Attributes:
        ticks: Number of compared commands.
        same_ticks: Number of identical commands.
        updates: Number of compared updates (estimate, offsets, features, status, ...).
        same_updates: Number of identical updates.
        first_difference: Where the first difference is; empty if there is none.
        ended: Why the rest of the log was not compared; empty if all was.
    """

    ticks: int = 0
    same_ticks: int = 0
    updates: int = 0
    same_updates: int = 0
    first_difference: str = ""
    ended: str = ""

    @property
    def is_identical(self) -> bool:
        """Whether everything compared is identical."""
        return not self.first_difference and self.ticks > 0


def replay_same(log: Log) -> tuple[Comparison, Recording]:
    """Run the recorded references, measurements and requests through the loop, in their order.

    The replay ends at the first missing tick, measurement or request, because later outputs depend
    on it.

    Returns:
        The comparison, and the replayed run.

    Raises:
        RecordError: The log has no tick at its start, or a request that this version does not know.
    """
    loop = HysteresisReduction(log.config, log.compensated)
    comparison, recorder = Comparison(), RunRecorder(log.config)
    clock, codec = log.clock, msg.Codec(log.config)
    prepared: dict[int, tuple[SeenFrame, Callable[[], Detection]]] = {}
    where = ""
    for index in range(1, max(log.events, default=0) + 1):
        event = log.events.get(index)
        if isinstance(event, Tick):
            sample, reference = event.sample, event.reference
            command = loop.step(reference, sample.time, event.made_at)
            recorder.add_tick(sample, reference, command)
            replayed = codec.tick(clock, sample, reference, command, event.made_at)
            comparison.ticks += 1
            where = f"tick at {sample.time:g} s"
            comparison.same_ticks += _is_same(comparison, event, replayed, where)
        elif isinstance(event, Request) and event.text.startswith(PREPARE):
            if (found := _prepared_update(log, index, event.text)) is not None:
                update, shown = found
                prepared[update] = shown, loop.prepare_detection(shown[1])
        elif isinstance(event, Request):
            _send_request(loop, event.text)
        elif event is not None and log.has_input(index):
            ready = prepared.pop(index, None)
            now, seen, count = ready[0] if ready else _seen(log, index)
            report = loop.on_detection(ready[0][1], ready[1]()) if ready else _update(loop, seen)
            recorder.add_update(now, seen, report, count)
            replayed = codec.update(clock, now, seen, report, count)
            comparison.updates += 1
            name = f"{'image' if isinstance(seen, Frame) else 'measurement'} {count}"
            comparison.same_updates += _is_same(comparison, event, replayed, name)
        else:
            missing = "an image" if event is not None else "a tick, update or request"
            after = f"after the {where}" if where else "at the start"
            entry = f"entry {index} of {max(log.events)}"
            comparison.ended = f"{after}, {missing} is not in the log ({entry})"
            break
    if not comparison.ticks:
        raise RecordError("log", comparison.ended, _WITH_TICK)
    return comparison, Recording(*recorder.tables(), log.config, log.compensated, log.segments)


def _prepared_update(log: Log, after: int, request: str) -> tuple[int, SeenFrame] | None:
    """The next update and its frame, if `request` prepared its detection.

    None if the detection had not ended when the run did, or its image is not in the log.
    """
    later = range(after + 1, next(reversed(log.events)) + 1)
    index = next((each for each in later if isinstance(log.events.get(each), Update)), None)
    if index is None or not log.has_image(index):
        return None
    now, frame, count = _seen(log, index)
    if not isinstance(frame, Frame) or request != f"{PREPARE}{count}":
        return None
    return index, (now, frame, count)


def _send_request(loop: HysteresisReduction, request: str) -> None:
    call, _, name = request.partition(" ")
    if request in ("engage", "acknowledge"):
        getattr(loop, request)()
    elif call == "raise_flag" and name in DETECTORS:
        loop.raise_flag(name)
    elif call == "set_compensation":
        try:
            loop.set_compensation(float(name))
        except ValueError:
            allowed = "set_compensation and a share from 0 to 1"
            raise RecordError("log", request, allowed) from None
    elif call != "note":
        allowed = "engage, acknowledge, raise_flag, set_compensation, prepare_detection, or a note"
        raise RecordError("log", request, allowed)


def _is_same(
    comparison: Comparison, event: Tick | Update, replayed: msg.Messages, where: str
) -> bool:
    different = [topic for topic, data in replayed.items() if event.raw.get(topic) != data]
    if different and not comparison.first_difference:
        comparison.first_difference = f"{where}: {', '.join(different)}"
    return not different


def _seen(log: Log, index: int) -> Seen:
    """Frame or measurement of a recorded update, as the loop got it."""
    update = log.events[index]
    assert isinstance(update, Update)
    row = update.row
    now, count = float(row["arrived_at"]), int(row["sequence"])
    if update.measurement is not None:
        return now, update.measurement, count
    truth = np.array([row[f"true_features_{name}"] for name in FEATURES], np.float64)
    known = None if np.isnan(truth).all() else truth
    return now, Frame(log.image(index), float(row["captured_at"]), count, known), count


def _update(loop: HysteresisReduction, seen: Frame | Measurement) -> Report:
    return loop.on_frame(seen) if isinstance(seen, Frame) else loop.on_sample(seen)


def estimate_from_log(log: Log, config: Config) -> tuple[Recording, int]:
    """Estimate the states and offsets of a recorded run with another configuration.

    Returns:
        The recorded references and commands with the new estimates, and the number of updates that
        were skipped because their image is not in the log.

    Raises:
        RecordError: The log has no tick.
        ConfigError: The configuration has other degrees of freedom than the log.
        FrameError: The configured camera is not the recorded one.
    """
    recorded, given = ([dof.label for dof in each.dofs] for each in (log.config, config))
    if recorded != given:
        allowed = f"those of the log: {', '.join(recorded)}"
        raise ConfigError("dof", ", ".join(given), allowed)
    run = _estimate(_log_inputs(log), config, log.compensated, log.segments)
    if not len(run.trace):
        raise RecordError("log", "no tick", _WITH_TICK)
    skipped = sum(
        isinstance(event, Update) and not log.has_input(index)
        for index, event in log.events.items()
    )
    return run, skipped


def estimate_from_video(
    frames: Iterable[Frame],
    times: Floats,
    positions: Floats,
    config: Config,
    progress: Callable[[float], None] | None = None,
) -> Recording:
    """Estimate states and offsets from a video and motor positions.

    Args:
        frames: Frames in order, captured on the clock of the motors.
        times: (n,) of the motor positions [s], increasing.
        positions: (n, 3) motor positions [m, rad, rad], `tautscope.replay.read_motors`.
        config: Configuration of instrument, camera and loop.
        progress: Called with the share of the motors' time that is done.

    Raises:
        RecordError: No frame is within the time of the motor positions.
        FrameError: The video is not from the configured camera.
    """
    run = _estimate(_video_inputs(frames, times, positions, progress), config, False, ())
    if not len(run.frames):
        span = f"frames between {times[0]:g} and {times[-1]:g} s, the time of the motor positions"
        raise RecordError("video", "no frame in that time", span)
    return run


def retimed(frames: Iterable[Frame], delay: DelayEstimate) -> Iterator[Frame]:
    """Frames with their capture times on the clock of the motors."""
    first: float | None = None
    for frame in frames:
        first = frame.captured_at if first is None else first
        yield replace(frame, captured_at=float(delay.motor_time(frame.captured_at, first)))


def _log_inputs(log: Log) -> Inputs:
    for index, event in log.events.items():
        if isinstance(event, Tick):
            yield event
        # Requests are left out: their effect on the motors is in the recorded commands.
        elif isinstance(event, Update) and log.has_input(index):
            yield _seen(log, index)


def _video_inputs(
    frames: Iterable[Frame],
    times: Floats,
    positions: Floats,
    progress: Callable[[float], None] | None,
) -> Inputs:
    ticks = [
        Tick(Sample(float(time), position), position, position, None, {})
        for time, position in zip(times, positions, strict=True)
    ]
    at = 0
    for frame in frames:
        while at < len(ticks) and times[at] <= frame.captured_at:
            yield ticks[at]
            at += 1
        if at == len(ticks):
            return  # the motor positions after the end of the table are unknown
        if at:
            yield frame.captured_at, frame, frame.sequence
        if progress is not None:
            progress(at / len(ticks))
    yield from ticks[at:]


def _estimate(
    inputs: Inputs, config: Config, compensated: bool, segments: tuple[Segment, ...]
) -> Recording:
    # Without compensation the loop passes commands on and only estimates.
    off = {"safety.off": [*config.safety.off, *_IGNORED]}
    loop = HysteresisReduction(config.replace(**off), compensate=False)
    recorder = RunRecorder(config)
    for each in inputs:
        if isinstance(each, Tick):
            loop.step(each.command, each.sample.time)
            recorder.add_tick(each.sample, each.reference, each.command)
        else:
            now, seen, count = each
            recorder.add_update(now, seen, _update(loop, seen), count)
    return Recording(*recorder.tables(), config, compensated, segments)
