"""A recorded run through the loop again.

With the configuration it was recorded with, the outputs must be the same to the bit. With another
one the loop listens: it is given the commands that moved the motors when the images were taken,
and says what it would have estimated. It cannot say how the instrument would have moved.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.errors import RecordError
from tautscope.log import messages as msg
from tautscope.log.cdr import decode
from tautscope.log.reader import Log, Tick, Told, Update
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.rig import Frame, Sample
from tautscope.loop.safety import DETECTORS
from tautscope.runs.recording import FEATURES, FRAME_COLUMNS, Recording
from tautscope.runs.records import read_motors
from tautscope.runs.run_recorder import RunRecorder, frame_row

Floats = NDArray[np.float64]


@dataclass(slots=True)
class Identity:
    """How much of a run came out the same, bit for bit.

    Attributes:
        ticks: Commands compared.
        same_ticks: Equal ones.
        updates: Image updates compared: estimate, offsets, features, status and all else.
        same_updates: Equal ones.
        first_difference: Where, in words; empty if there is none.
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
        """Whether all that was compared is equal."""
        return not self.first_difference and self.ticks > 0


def replay_same(log: Log) -> tuple[Identity, Recording]:
    """Run the recorded references, images and events through the loop, in the recorded order.

    Ends at a hole: what comes after a tick or an image that is not in the log depends on it.

    Returns:
        What was the same, and the run as it came out now.

    Raises:
        RecordError: The log has no tick, or an event that this version does not know.
    """
    loop = HysteresisReduction(log.config, log.compensated)
    found, recorder = Identity(), RunRecorder(log.config)
    clock = _clock(log)
    for index in range(1, max(log.events, default=0) + 1):
        event = log.events.get(index)
        if isinstance(event, Tick):
            command = loop.step(event.reference, event.sample.time, event.made_at)
            recorder.add_tick(event.sample, event.reference, command)
            inputs = event.sample, event.reference
            again = msg.tick_messages(clock, *inputs, command, event.made_at)
            found.ticks += 1
            found.same_ticks += _is_same(found, event, again, f"tick at {event.sample.time:g} s")
        elif isinstance(event, Told):
            _tell(loop, event.what)
        elif event is not None and log.has_image(index):
            now, frame = _frame(log, index, event)
            report = loop.on_frame(frame)
            recorder.add_frame(frame_row(now, frame, report), report.delta_minus, report.delta_plus)
            again = msg.update_messages(clock, now, frame, report)
            found.updates += 1
            found.same_updates += _is_same(found, event, again, f"image {frame.sequence}")
        else:
            what = "image" if event is not None else "tick, image update or event"
            found.ended = f"{what} {index} of {max(log.events)} is not in the log"
            break
    return found, Recording(*recorder.tables(), log.config, log.compensated, log.segments)


def _tell(loop: HysteresisReduction, what: str) -> None:
    call, _, name = what.partition(" ")
    if what in ("engage", "acknowledge"):
        getattr(loop, what)()
    elif call == "raise_flag" and name in DETECTORS:
        loop.raise_flag(name)
    else:
        raise RecordError("log", what, "engage, acknowledge, or raise_flag and a known name")


def _is_same(found: Identity, event: Tick | Update, again: msg.Messages, where: str) -> bool:
    other = [topic for topic, data in again.items() if event.raw.get(topic) != data]
    if other and not found.first_difference:
        found.first_difference = f"{where}: {', '.join(other)}"
    return not other


def _clock(log: Log) -> msg.Clock:
    ticks = [event for event in log.events.values() if isinstance(event, Tick)]
    if not ticks:
        raise RecordError("log", str(log.path), "one with at least one tick")
    stamp = decode(msg.TOPICS[msg.COMMAND], ticks[0].raw[msg.COMMAND])["header"]["stamp"]
    return msg.Clock(ticks[0].sample.time, stamp["sec"] * 10**9 + stamp["nanosec"])


def _frame(log: Log, index: int, update: Update) -> tuple[float, Frame]:
    """When a frame arrived, and the frame as the loop was given it."""
    row = dict(zip(FRAME_COLUMNS.names or (), update.row, strict=True))
    truth = np.array([row[f"true_features_{name}"] for name in FEATURES], np.float64)
    frame = Frame(
        log.image(index),
        float(row["captured_at"]),  # type: ignore[arg-type]
        int(row["sequence"]),  # type: ignore[call-overload]
        None if np.isnan(truth).all() else truth,
    )
    return float(row["arrived_at"]), frame  # type: ignore[arg-type]


@dataclass(slots=True)
class Heard:
    """A run the loop has only listened to.

    Attributes:
        recording: References and commands as they were, estimates and offsets of this loop.
        skipped: Image updates whose image is not in the log.
    """

    recording: Recording
    skipped: int = 0


@dataclass(frozen=True, slots=True)
class _Motion:
    """Where the motors were told to be, and what was wanted."""

    sample: Sample
    reference: Floats
    command: Floats


@dataclass(frozen=True, slots=True)
class _Sight:
    """A frame and when it arrived."""

    now: float
    frame: Frame


@dataclass(slots=True)
class _Count:
    skipped: int = field(default=0)


def listen_to_log(log: Log, config: Config) -> Heard:
    """What a loop with another configuration would have estimated in a recorded run.

    Raises:
        FrameError: Its camera is not the recorded one.
    """
    count = _Count()
    recording = _listen(_of_log(log, count), config, log.compensated)
    return Heard(
        Recording(recording.trace, recording.frames, config, log.compensated, log.segments),
        count.skipped,
    )


def listen_to_video(frames: Iterable[Frame], motors: str | PathLike[str], config: Config) -> Heard:
    """What the loop estimates from a plain video and a table of motor positions.

    Args:
        frames: In order, captured on the clock of the table.
        motors: CSV file, see `tautscope.runs.records.read_motors`.
        config: Of instrument, camera and loop.

    Raises:
        MissingPathError, RecordError: As `read_motors`; or no frame was taken while it lasts.
        FrameError: The video is not of the configured camera.
    """
    times, positions = read_motors(motors)
    recording = _listen(_of_video(frames, times, positions), config, False)
    if not len(recording.frames):
        span = f"frames between {times[0]:g} and {times[-1]:g} s, the time of {motors}"
        raise RecordError("video", "no frame in that time", span)
    return Heard(recording)


def _of_log(log: Log, count: _Count) -> Iterator[_Motion | _Sight]:
    for index, event in log.events.items():
        if isinstance(event, Tick):
            yield _Motion(event.sample, event.reference, event.command)
        elif isinstance(event, Told):
            continue  # it listens: what held the motors then is in their commands
        elif log.has_image(index):
            yield _Sight(*_frame(log, index, event))
        else:
            count.skipped += 1


def _of_video(
    frames: Iterable[Frame], times: Floats, positions: Floats
) -> Iterator[_Motion | _Sight]:
    at = 0
    for frame in frames:
        while at < len(times) and times[at] <= frame.captured_at:
            yield _Motion(Sample(float(times[at]), positions[at]), positions[at], positions[at])
            at += 1
        if at == len(times):
            return  # where the motors are now, nobody has written down
        if at:
            yield _Sight(frame.captured_at, frame)
    for time, position in zip(times[at:], positions[at:], strict=True):
        yield _Motion(Sample(float(time), position), position, position)


def _listen(inputs: Iterable[_Motion | _Sight], config: Config, compensated: bool) -> Recording:
    # Without compensation a command is passed on as it is, and the estimators only listen. What
    # moved the motors then is not to be refused now, commands are faster than a hand, and a codec
    # repeats pictures.
    deaf = ("reference_jump", "reference_late", "late_tick", "monitor", "frozen")
    moved = {"safety.off": [*config.safety.off, *deaf]}
    loop = HysteresisReduction(config.replace(**moved), compensate=False)
    recorder = RunRecorder(config)
    for each in inputs:
        if isinstance(each, _Motion):
            loop.step(each.command, each.sample.time)
            recorder.add_tick(each.sample, each.reference, each.command)
        else:
            report = loop.on_frame(each.frame)
            row = frame_row(each.now, each.frame, report)
            recorder.add_frame(row, report.delta_minus, report.delta_plus)
    return Recording(*recorder.tables(), config, compensated, ())
