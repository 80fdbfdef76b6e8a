"""What waits to be recorded, and the two threads that encode and write it."""

from __future__ import annotations

import os
import time
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from tautscope.errors import OutputError
from tautscope.log import messages as msg
from tautscope.log.images import ImageCodec
from tautscope.log.mcap_file import McapFile
from tautscope.loop.rig import Sample

LOOK_PERIOD = 0.01
"""How often the threads look for news [s]: far below the `flush_period`."""


class Journal:
    """Queues that the loop fills, and a file that two threads write.

    Appending to a deque and popping from it need no lock.

    Args:
        path: The file; there may be none yet.
        facts: What the log says of the run; `recording` of its configuration says how to record.
        say: Told once of each trouble, by a thread.

    Attributes:
        events: Index, time [s] and the arguments of `tick_messages`, `update_messages` or
            `event_messages`.
        images: Index, time, time of capture [s], pixels.
        texts: Time or None, and a warning.
        clock: From the loop's first call on.
        dropped: Ticks, updates and events it could not take.
        dropped_images: Images it could not take.
        failure: Why nothing is recorded any more; empty while it is.
        written: Topic -> number of messages.

    Raises:
        OutputError: The file is there already, or cannot be made.
    """

    def __init__(self, path: Path, facts: msg.Facts, say: Callable[[str], None]) -> None:
        self.path = path
        self.events: deque[tuple[int, float, tuple[Any, ...]]] = deque()
        self.images: deque[tuple[int, float, float, NDArray[np.uint8]]] = deque()
        self.texts: deque[tuple[float | None, str]] = deque()
        self._coded: deque[tuple[int, float, float, bytes]] = deque()
        self.clock: msg.Clock | None = None
        self.dropped = self.dropped_images = 0
        self.failure = ""
        self.written: Counter[str] = Counter()
        self._facts, self._say = facts, say
        self._settings = facts.config.recording
        self._codec = ImageCodec(facts.config.camera, self._settings)
        self._is_closing, self._is_encoded, self._is_done = Event(), Event(), Event()
        self._file = _open(path)
        self._thread = Thread(target=self._work, name="recording", daemon=True)
        self._thread.start()
        Thread(target=self._encode, name="image encoding", daemon=True).start()

    @property
    def is_done(self) -> bool:
        """Whether nothing is written any more."""
        return self._is_done.is_set()

    def end(self, timeout: float) -> None:
        """Have what waits written, for `timeout` [s] at most. May be called twice."""
        self._is_closing.set()
        self._thread.join(timeout)
        if self._thread.is_alive() and not self.failure:
            self.failure = f"the disk did not take the rest in {timeout:g} s"
            self._say(f"{self.path}: {self.failure}")

    def _work(self) -> None:
        """The thread that writes."""
        try:
            with self._file:
                self._write()
        except Exception as error:  # whatever it is, the run goes on
            self.failure = f"{type(error).__name__}: {error}"
            with suppress(OSError):
                self._file.close()
        finally:
            self._is_done.set()
        if self.failure:
            images = len(self.images) + len(self._coded)
            waiting = len(self.events) + images
            self.dropped += len(self.events)
            self.dropped_images += images
            self._say(
                f"{self.path}: recording ended, {waiting} messages are lost and nothing more is "
                f"recorded; the run goes on ({self.failure})"
            )

    def _write(self) -> None:
        file = McapFile(self._file)
        self.written = file.counts
        stamp = time.time_ns()
        for topic, data in msg.head_messages(self._facts, stamp).items():
            file.add(topic, data, 0, stamp)
        file.flush()
        flushed = synced = time.monotonic()
        is_told = False
        while True:
            # Asked before the queues, so that nothing is missed.
            is_last = self._is_closing.is_set() and self._is_encoded.is_set()
            self._write_events(file)
            self._write_images(file)
            if (self.dropped or self.dropped_images) and not is_told:
                is_told = True
                self._trouble("the disk or the encoder is too slow; ticks or images are dropped")
            if is_last:
                break
            now = time.monotonic()
            if now - flushed >= self._settings.flush_period:
                file.flush()
                flushed = now
            if now - synced >= self._settings.sync_period:
                self._sync()
                synced = time.monotonic()
            time.sleep(LOOK_PERIOD)
        if is_told:
            self._trouble(
                f"{self.dropped} ticks, updates, events and {self.dropped_images} images were "
                "dropped"
            )
            self._write_events(file)
        file.finish()
        self._sync()

    def _sync(self) -> None:
        """To the disk, and out of memory: gigabytes nobody reads would push out what others run."""
        os.fsync(self._file.fileno())
        with suppress(OSError, AttributeError):  # advice, which not every system takes
            os.posix_fadvise(self._file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)

    def _trouble(self, text: str) -> None:
        self._say(f"{self.path}: {text}")
        self.texts.append((None, text))

    def _write_events(self, file: McapFile) -> None:
        """Everything but the images, which may come later in the file."""
        while self.texts:
            now, text = self.texts.popleft()
            clock = self.clock
            at = time.time_ns() if clock is None or now is None else clock.nanoseconds(now)
            file.add(msg.WARNING, msg.warning_message(at, text), 0, at)
        while self.events:
            index, now, facts = self.events.popleft()
            clock = self.clock
            assert clock is not None
            for topic, data in _messages(clock, facts).items():
                file.add(topic, data, index, clock.nanoseconds(now))

    def _write_images(self, file: McapFile) -> None:
        """One at a time: an image takes longer than all ticks that wait meanwhile."""
        while self._coded:
            index, now, captured_at, data = self._coded.popleft()
            clock = self.clock
            assert clock is not None
            message = msg.image_message(clock, captured_at, self._codec.format, data)
            file.add(msg.IMAGE, message, index, clock.nanoseconds(now))
            self._write_events(file)

    def _encode(self) -> None:
        """The thread that encodes: an image takes longer than a tick may wait."""
        limit = self._settings.queue_images
        is_told = False
        while not self._is_done.is_set():
            # Asked before the queue, so that nothing is missed.
            is_last = self._is_closing.is_set()
            if not self.images or len(self._coded) >= limit:
                if is_last and not self.images:
                    break
                time.sleep(LOOK_PERIOD)
                continue
            index, now, captured_at, image = self.images[0]
            try:
                self._coded.append((index, now, captured_at, self._codec.encode(image)))
            except Exception as error:  # an image that is none; the ticks go on
                self.dropped_images += 1
                if not is_told:
                    self._trouble(f"image {index} cannot be encoded ({error})")
                is_told = True
            self.images.popleft()
        self._is_encoded.set()


def _messages(clock: msg.Clock, facts: tuple[Any, ...]) -> msg.Messages:
    if isinstance(facts[0], str):
        return msg.event_messages(*facts)
    kind = msg.tick_messages if isinstance(facts[0], Sample) else msg.update_messages
    return kind(clock, *facts)


def _open(path: Path) -> IO[bytes]:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("xb", buffering=0)
    except FileExistsError:
        raise OutputError("log", str(path), "a file that does not exist yet") from None
    except OSError as error:
        raise OutputError("log", str(path), f"a place that can be written ({error})") from None
