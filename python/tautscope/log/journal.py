"""Queues of what is to be recorded, and the two threads that encode and write it."""

import os
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread
from typing import IO

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.config.recording import IMAGE_FORMATS, ImageFormat
from tautscope.errors import OutputError
from tautscope.log import messages as msg
from tautscope.log import topics
from tautscope.log.header import header_messages
from tautscope.log.images import ImageCodec
from tautscope.log.mcap_file import McapFile
from tautscope.loop.references import Segment

POLL_PERIOD = 0.01
"""Polling period of the threads [s], far below the `flush_period`."""


class Journal:
    """Queues that the loop fills and two threads empty into a file.

    The queues are deques, whose append and pop need no lock. The constructor writes the header,
    without which nothing of a log can be read: the log of a process that is killed is readable.

    Args:
        path: New file.
        config: Configuration of the run; section `recording` has the recording settings.
        compensated: Whether the loop compensates.
        segments: Which DOF moves when.
        on_warning: Called by a thread, once per kind of problem.

    Attributes:
        events: Index, wall clock time [ns], and what makes the messages.
        images: Index, wall clock times of arrival and capture [ns], pixels, format.
        warnings: Their texts.
        dropped: Number of dropped ticks, updates and requests.
        dropped_images: Number of dropped images.
        failure: Why recording stopped; empty while it works.
        written: Topic -> number of messages.
        done: Set when writing has ended.

    Raises:
        OutputError: The file exists already, or cannot be created or written.
    """

    def __init__(
        self,
        path: Path,
        config: Config,
        compensated: bool,
        segments: Iterable[Segment],
        on_warning: Callable[[str], None],
    ) -> None:
        self.path = path
        self.events: deque[tuple[int, int, Callable[[], msg.Messages]]] = deque()
        self.images: deque[tuple[int, int, int, NDArray[np.uint8], ImageFormat]] = deque()
        self.warnings: deque[str] = deque()
        self._encoded_images: deque[tuple[int, int, bytes]] = deque()
        self.dropped = self.dropped_images = 0
        self.failure = ""
        self._on_warning = on_warning
        self._settings = config.recording
        self._codecs: dict[ImageFormat, ImageCodec] = {
            kind: ImageCodec(config.camera, replace(self._settings, image_format=kind))
            for kind in IMAGE_FORMATS
        }
        self._is_closing, self._is_encoded, self.done = Event(), Event(), Event()
        self._file = _open(path)
        stamp = time.time_ns()
        header = header_messages(config, compensated, segments, stamp)
        self._log = _begin(path, self._file, header, stamp)
        self.written: Counter[str] = self._log.counts
        self._thread = Thread(target=self._run_writer, name="recording", daemon=True)
        self._thread.start()
        Thread(target=self._run_encoder, name="image encoding", daemon=True).start()

    def close(self, timeout: float) -> None:
        """Wait until the queues are written, at most `timeout` [s]. May be called twice."""
        self._is_closing.set()
        self._thread.join(timeout)
        if self._thread.is_alive() and not self.failure:
            self.failure = f"the disk was too slow to write the rest within {timeout:g} s"
            self._on_warning(f"{self.path}: {self.failure}")

    def _run_writer(self) -> None:
        """Run the thread that writes."""
        try:
            with self._file:
                self._write_log()
        except Exception as error:  # no error of the recording may end the run
            self.failure = f"{type(error).__name__}: {error}"
            with suppress(OSError):
                self._file.close()
        finally:
            self.done.set()
        if self.failure:
            images = len(self.images) + len(self._encoded_images)
            waiting = len(self.events) + images
            self.dropped += len(self.events)
            self.dropped_images += images
            self._on_warning(
                f"{self.path}: recording ended ({self.failure}); {waiting} messages are lost, "
                "the run goes on"
            )

    def _write_log(self) -> None:
        flushed = synced = time.monotonic()
        has_warned = False
        while True:
            # Read before the queues are emptied: what is queued later is written in the next pass.
            is_last = self._is_closing.is_set() and self._is_encoded.is_set()
            self._write_events()
            self._write_images()
            if (self.dropped or self.dropped_images) and not has_warned:
                has_warned = True
                self._warn("the disk or the encoder is too slow; ticks or images are dropped")
            if is_last:
                break
            now = time.monotonic()
            if now - flushed >= self._settings.flush_period:
                self._log.flush()
                flushed = now
            if now - synced >= self._settings.sync_period:
                self._sync()
                synced = time.monotonic()
            time.sleep(POLL_PERIOD)
        if has_warned:
            self._warn(
                f"{self.dropped} ticks, updates, events and {self.dropped_images} images were "
                "dropped"
            )
            self._write_events()
        self._log.finish()
        self._sync()

    def _sync(self) -> None:
        """Write to the disk and release the page cache, which would fill the memory."""
        os.fsync(self._file.fileno())
        with suppress(OSError, AttributeError):  # not on every system
            os.posix_fadvise(self._file.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)

    def _warn(self, text: str) -> None:
        self._on_warning(f"{self.path}: {text}")
        self.warnings.append(text)

    def _write_events(self) -> None:
        """Write everything but the images."""
        while self.warnings:
            stamp = time.time_ns()
            message = msg.warning_message(stamp, self.warnings.popleft())
            self._log.add(topics.WARNING, message, 0, stamp)
        while self.events:
            index, at, encode = self.events.popleft()
            for topic, data in encode().items():
                self._log.add(topic, data, index, at)

    def _write_images(self) -> None:
        """Write the images, and after each one the events, which are quicker to write."""
        while self._encoded_images:
            index, at, message = self._encoded_images.popleft()
            self._log.add(topics.IMAGE, message, index, at)
            self._write_events()

    def _run_encoder(self) -> None:
        """Run the thread that encodes images, so that ticks do not wait for the encoder."""
        limit = self._settings.queue_images
        has_warned = False
        while not self.done.is_set():
            is_last = self._is_closing.is_set()  # before the queue, as in the other thread
            if not self.images or len(self._encoded_images) >= limit:
                if is_last and not self.images:
                    break
                time.sleep(POLL_PERIOD)
                continue
            index, at, captured_at, image, kind = self.images[0]
            codec = self._codecs[kind]
            try:
                message = msg.image_message(captured_at, codec.format, codec.encode(image))
                self._encoded_images.append((index, at, message))
            except Exception as error:  # an invalid image is dropped; the recording goes on
                self.dropped_images += 1
                if not has_warned:
                    self._warn(f"image {index} cannot be encoded ({error})")
                has_warned = True
            self.images.popleft()
        self._is_encoded.set()


def _open(path: Path) -> IO[bytes]:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("xb", buffering=0)
    except FileExistsError:
        raise OutputError("log", str(path), "a file that does not exist yet") from None
    except OSError as error:
        raise OutputError("log", str(path), f"a place that can be written ({error})") from None


def _begin(path: Path, file: IO[bytes], messages: Mapping[str, bytes], stamp: int) -> McapFile:
    """Write the header; the file is removed if it cannot be written."""
    try:
        log = McapFile(file)
        for topic, data in messages.items():
            log.add(topic, data, 0, stamp)
        log.flush()
    except OSError as error:
        with suppress(OSError):
            file.close()
        path.unlink(missing_ok=True)
        raise OutputError("log", str(path), f"a place that can be written ({error})") from None
    return log
