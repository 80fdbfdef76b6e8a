"""The log of a run, written while it goes on, by threads of its own.

The loop only puts references into bounded queues: no encoding, no lock, no file. What does not fit
is dropped and counted; a disk that fails ends the recording, never the run.
"""

from __future__ import annotations

import os
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from threading import Event, Thread
from types import TracebackType
from typing import IO, Any

import numpy as np
from mcap.writer import Writer
from numpy.typing import NDArray

from tautscope._core import __version__
from tautscope.config import Config
from tautscope.errors import OutputError
from tautscope.log import messages as msg
from tautscope.log.cdr import schema
from tautscope.log.images import ImageCodec
from tautscope.reduction import Report
from tautscope.references import Segment
from tautscope.rig import Frame, Sample

_LOOK_PERIOD = 0.01
"""How often the threads look for news [s]: far below the `flush_period`."""


@dataclass(frozen=True, slots=True)
class LogSummary:
    """What is in a log, and what is not.

    Attributes:
        path: The file.
        messages: Topic -> how many were written.
        ticks: Control ticks given to the log.
        updates: Image updates given to it.
        dropped: Ticks and updates it could not take.
        dropped_images: Images of other updates it could not take.
        failure: Why it ended before its time; empty if it did not.
    """

    path: Path
    messages: dict[str, int]
    ticks: int
    updates: int
    dropped: int
    dropped_images: int
    failure: str

    @property
    def is_complete(self) -> bool:
        """Whether all that was given is in the file."""
        return not (self.dropped or self.dropped_images or self.failure)


@dataclass(slots=True)
class _Queues:
    """What waits for the threads. Appending and popping a deque need no lock."""

    events: deque[tuple[int, float, tuple[Any, ...]]] = field(default_factory=deque)
    images: deque[tuple[int, float, float, NDArray[np.uint8]]] = field(default_factory=deque)
    coded: deque[tuple[int, float, float, bytes]] = field(default_factory=deque)
    texts: deque[tuple[float | None, str]] = field(default_factory=deque)


def _say(text: str) -> None:
    print(f"warning: {text}", file=sys.stderr, flush=True)


class LogWriter:
    """Writes an MCAP file; a context manager.

    `tick` and `frame` are called by the loop, in the order of the loop's own calls; that order is
    in the file as the messages' sequence number, one per tick or update, from 1 on.

    Args:
        path: The file; there may be none yet.
        config: As used by the loop; `recording` says how to record.
        compensate: As given to the loop.
        segments: Which DOF moves when, if that is known.
        wait: Rather than drop, have the caller wait: for a simulated rig, whose clock can stand.
        say: Told once of each trouble, by the thread; without it, a line on stderr.

    Raises:
        OutputError: The file is there already, or cannot be made.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        config: Config,
        *,
        compensate: bool = True,
        segments: Iterable[Segment] = (),
        wait: bool = False,
        say: Callable[[str], None] = _say,
    ) -> None:
        self._path = Path(path)
        self._settings = config.recording
        self._facts = msg.Facts(config, compensate, tuple(segments))
        self._codec = ImageCodec(config.camera, config.recording)
        self._wait = wait
        self._say = say
        self._clock: msg.Clock | None = None
        self._queues = _Queues()
        self._ticks = self._updates = self._dropped = self._dropped_images = 0
        self._failure = ""
        self._written: Counter[str] = Counter()
        self._is_closing, self._is_encoded, self._is_done = Event(), Event(), Event()
        self._file = _open(self._path)
        self._thread = Thread(target=self._work, name="recording", daemon=True)
        self._thread.start()
        Thread(target=self._encode, name="image encoding", daemon=True).start()

    def tick(self, sample: Sample, reference: Iterable[float], command: Iterable[float]) -> None:
        """One control tick: the sample before it, reference u (3,) and command c (3,)."""
        if self._clock is None:
            self._clock = msg.Clock(sample.time, time.time_ns())
        self._ticks += 1
        # Copies: the caller may use its arrays again before they are written.
        truth = None if sample.true_state is None else np.array(sample.true_state)
        kept = Sample(sample.time, np.array(sample.applied), None, truth)
        self._put(sample.time, (kept, np.array(reference), np.array(command)))

    def frame(self, now: float, frame: Frame, report: Report) -> None:
        """One image update, after the tick in whose sample the frame came.

        Args:
            now: That sample's time [s].
            frame: The frame; its image is copied, a rig may use the memory again.
            report: What the loop made of it.
        """
        if self._clock is None:
            self._clock = msg.Clock(now, time.time_ns())
        self._updates += 1
        about = Frame(np.empty(0, np.uint8), frame.captured_at, frame.sequence, frame.true_features)
        if not self._put(now, (now, about, report)):
            return
        if not self._has_room(self._queues.images, self._settings.queue_images):
            self._dropped_images += 1
            return
        index = self._ticks + self._updates
        self._queues.images.append((index, now, frame.captured_at, frame.image.copy()))

    def warn(self, text: str, now: float | None = None) -> None:
        """Something a person who reads the log should know, at a time of the rig's clock [s]."""
        self._queues.texts.append((now, text))

    @property
    def dropped(self) -> int:
        """Ticks, updates and images that could not be taken, up to now."""
        return self._dropped + self._dropped_images

    @property
    def failure(self) -> str:
        """Why nothing is recorded any more; empty while it is."""
        return self._failure

    def close(self) -> LogSummary:
        """Write what waits, end the file, and say what is in it. May be called twice."""
        self._is_closing.set()
        self._thread.join(self._settings.close_timeout)
        if self._thread.is_alive() and not self._failure:
            self._failure = f"the disk did not take the rest in {self._settings.close_timeout:g} s"
            self._say(f"{self._path}: {self._failure}")
        return LogSummary(
            self._path,
            dict(self._written),
            self._ticks,
            self._updates,
            self._dropped,
            self._dropped_images,
            self._failure,
        )

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is not None:
            self.warn(f"the run ended with {type(error).__name__}: {error}")
        self.close()

    def _put(self, now: float, facts: tuple[Any, ...]) -> bool:
        if not self._has_room(self._queues.events, self._settings.queue_events):
            self._dropped += 1
            return False
        self._queues.events.append((self._ticks + self._updates, now, facts))
        return True

    def _has_room(self, queue: deque[Any], limit: int) -> bool:
        while self._wait and len(queue) >= limit and not self._is_done.is_set():
            time.sleep(_LOOK_PERIOD)
        return len(queue) < limit and not self._is_done.is_set()

    def _work(self) -> None:
        """The thread."""
        try:
            with self._file:
                self._write()
        except Exception as error:  # whatever it is, the run goes on
            self._failure = f"{type(error).__name__}: {error}"
            with suppress(OSError):
                self._file.close()
        finally:
            self._is_done.set()
        if self._failure:
            images = len(self._queues.images) + len(self._queues.coded)
            waiting = len(self._queues.events) + images
            self._dropped += len(self._queues.events)
            self._dropped_images += images
            self._say(
                f"{self._path}: recording ended, {waiting} messages are lost and nothing more is "
                f"recorded; the run goes on ({self._failure})"
            )

    def _write(self) -> None:
        writer = Writer(_Sink(self._file))  # type: ignore[arg-type]  # it calls these three
        writer.start("ros2", f"tautscope {__version__}")
        channels = register_channels(writer)
        stamp = time.time_ns()

        def put(topic: str, data: bytes, index: int, at: int) -> None:
            writer.add_message(channels[topic], at, data, at, index)
            self._written[topic] += 1

        for topic, data in msg.head_messages(self._facts, stamp).items():
            put(topic, data, 0, stamp)
        writer.flush()  # type: ignore[no-untyped-call]
        flushed = synced = time.monotonic()
        told = 0
        while True:
            # Asked before the queues, so that nothing is missed.
            last = self._is_closing.is_set() and self._is_encoded.is_set()
            self._write_events(put)
            self._write_images(put)
            if self.dropped and not told:
                told = self.dropped
                self._trouble("the disk or the encoder is too slow; ticks or images are dropped")
            if last:
                break
            now = time.monotonic()
            if now - flushed >= self._settings.flush_period:
                writer.flush()  # type: ignore[no-untyped-call]
                flushed = now
            if now - synced >= self._settings.sync_period:
                os.fsync(self._file.fileno())
                synced = time.monotonic()
            time.sleep(_LOOK_PERIOD)
        if told:
            self._trouble(
                f"{self._dropped} ticks and updates and {self._dropped_images} images were dropped"
            )
            self._write_events(put)
        writer.finish()  # type: ignore[no-untyped-call]
        os.fsync(self._file.fileno())

    def _trouble(self, text: str) -> None:
        self._say(f"{self._path}: {text}")
        self.warn(text)

    def _write_events(self, put: Callable[[str, bytes, int, int], None]) -> None:
        """Everything but the images, which may come later in the file."""
        while self._queues.texts:
            now, text = self._queues.texts.popleft()
            on_rig = self._clock is not None and now is not None
            at = self._clock.nanoseconds(now) if on_rig else time.time_ns()  # type: ignore[union-attr,arg-type]
            put(msg.WARNING, msg.warning_message(at, text), 0, at)
        while self._queues.events:
            index, now, facts = self._queues.events.popleft()
            clock = self._clock
            assert clock is not None
            kind = msg.tick_messages if isinstance(facts[0], Sample) else msg.update_messages
            for topic, data in kind(clock, *facts).items():
                put(topic, data, index, clock.nanoseconds(now))

    def _write_images(self, put: Callable[[str, bytes, int, int], None]) -> None:
        while self._queues.coded:
            index, now, captured_at, data = self._queues.coded.popleft()
            clock = self._clock
            assert clock is not None
            message = msg.image_message(clock, captured_at, self._codec.format, data)
            put(msg.IMAGE, message, index, clock.nanoseconds(now))

    def _encode(self) -> None:
        """The other thread: an image takes longer to encode than a tick may wait."""
        queues, limit = self._queues, self._settings.queue_images
        told = False
        while not self._is_done.is_set():
            # Asked before the queue, so that nothing is missed.
            is_last = self._is_closing.is_set()
            if not queues.images or len(queues.coded) >= limit:
                if is_last and not queues.images:
                    break
                time.sleep(_LOOK_PERIOD)
                continue
            index, now, captured_at, image = queues.images[0]
            try:
                queues.coded.append((index, now, captured_at, self._codec.encode(image)))
            except Exception as error:  # an image that is none; the ticks go on
                self._dropped_images += 1
                if not told:
                    self._trouble(f"image {index} cannot be encoded ({error})")
                told = True
            queues.images.popleft()
        self._is_encoded.set()


def register_channels(writer: Writer) -> dict[str, int]:
    """Topic -> channel, for every topic, used or not."""
    schemas = {
        kind: writer.register_schema(kind, "ros2msg", schema(kind))
        for kind in sorted(set(msg.TOPICS.values()))
    }
    qos = {"offered_qos_profiles": ""}
    return {
        topic: writer.register_channel(topic, "cdr", schemas[kind], qos)
        for topic, kind in msg.TOPICS.items()
    }


class _Sink:
    """A file without a buffer of ours: what the library has written is the system's."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self._at = 0

    def write(self, data: bytes) -> int:
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]
        self._at += len(data)
        return len(data)

    def tell(self) -> int:
        return self._at

    def flush(self) -> None:
        """Nothing to do."""


def _open(path: Path) -> IO[bytes]:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("xb", buffering=0)
    except FileExistsError:
        raise OutputError("log", str(path), "a file that does not exist yet") from None
    except OSError as error:
        raise OutputError("log", str(path), f"a place that can be written ({error})") from None
