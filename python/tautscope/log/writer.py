"""The log of a run, written by background threads during the run.

The loop only appends to bounded queues: no encoding, no lock, no file access. What does not fit is
dropped and counted. A failing disk ends the recording, not the run.
"""

from __future__ import annotations

import logging
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from tautscope.config import Config
from tautscope.config.recording import IMAGE_FORMATS, ImageFormat
from tautscope.errors import FieldError, notes
from tautscope.log import messages as msg
from tautscope.log.journal import POLL_PERIOD, Journal
from tautscope.loop.measurement import Measurement
from tautscope.loop.reduction import Report
from tautscope.loop.references import Segment
from tautscope.loop.rig import Frame, Sample

_LOG = logging.getLogger(__name__)
_ENDS = {KeyboardInterrupt: "the run was interrupted", SystemExit: "the run was terminated"}
"""How a run ended, by the exception's type."""


@contextmanager
def run_log(path: Path, config: Config, **options: Any) -> Iterator[LogWriter]:
    """The log of a run in a new folder, with the options of `LogWriter`.

    A run that fails before its first tick leaves neither log nor folder; a later error gets a note
    that names the log.
    """
    log = LogWriter(path, config, **options)
    try:
        with log:
            yield log
    except BaseException as error:
        if log.has_begun:
            error.add_note(f"The log of the run is {path}: `tautscope report {path}`")
        else:  # nothing to keep: the same folder can be used again
            path.unlink()
            with suppress(OSError):
                path.parent.rmdir()
        raise


@dataclass(frozen=True, slots=True)
class LogSummary:
    """Numbers of recorded and dropped messages.

    Attributes:
        path: The file.
        messages: Topic -> number of written messages.
        ticks: Number of control ticks given to the log.
        updates: Number of updates given to the log.
        dropped: Number of dropped ticks, updates and requests.
        dropped_images: Number of other updates whose image was dropped.
        failure: Why recording stopped early; empty if it did not.
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
        """Whether everything given to the log is in the file."""
        return not (self.dropped or self.dropped_images or self.failure)


class LogWriter:
    """Writes the log of a run as an MCAP file; a context manager.

    Call `tick`, `frame`, `measurement` and `event` in the order of the loop's own calls. The
    messages' sequence number is the position in this order, from 1 on.

    Args:
        path: New file.
        config: Configuration of the loop; section `recording` has the recording settings.
        compensate: Whether the loop compensates.
        segments: Which DOF moves when, if known.
        wait: Make the caller wait for a full queue instead of dropping; for simulated rigs.
        on_warning: Called from a background thread, once per kind of problem; by default the
            package's logger warns.

    Attributes:
        image_format: Of the next images; `recording.image_format` at first, may be set.

    Raises:
        FieldError: `image_format` is set to another one than those of `recording.image_format`.
        OutputError: The file exists already, or cannot be created or written.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        config: Config,
        *,
        compensate: bool = True,
        segments: Iterable[Segment] = (),
        wait: bool = False,
        on_warning: Callable[[str], None] = _LOG.warning,
    ) -> None:
        self._settings = config.recording
        self.image_format = config.recording.image_format
        self._wait = wait
        self._ticks = self._updates = self._index = 0
        self._codec, self._clock = msg.Codec(config), msg.Clock(0.0, 0)
        self._journal = Journal(Path(path), config, compensate, segments, on_warning)

    @property
    def image_format(self) -> ImageFormat:
        """See the class."""
        return self._image_format

    @image_format.setter
    def image_format(self, name: ImageFormat) -> None:
        if name not in IMAGE_FORMATS:
            raise FieldError("image_format", name, f"one of {', '.join(IMAGE_FORMATS)}")
        self._image_format = name

    def tick(
        self,
        sample: Sample,
        reference: Iterable[float],
        command: Iterable[float],
        made_at: float | None = None,
    ) -> None:
        """Record a control tick: the sample before it, reference u (n,) and command c (n,).

        `made_at` is the rig time of the reference [s], if the loop got it.
        """
        self._ticks += 1
        # Copies, because the caller may reuse its arrays before they are written.
        truth = None if sample.true_state is None else np.array(sample.true_state)
        copy = Sample(sample.time, np.array(sample.applied), None, truth)
        self._enqueue(
            sample.time, self._codec.tick, copy, np.array(reference), np.array(command), made_at
        )

    def frame(self, now: float, frame: Frame, report: Report) -> None:
        """Record an image update, after the tick whose sample has the frame.

        Args:
            now: Time of that sample [s].
            frame: The frame; its image is copied.
            report: Result of the update.
        """
        self._updates += 1
        info = replace(frame, image=np.empty(0, np.uint8))
        if not self._enqueue(now, self._codec.update, now, info, report, self._updates):
            return
        journal = self._journal
        if not self._has_room(journal.images, self._settings.queue_images):
            journal.dropped_images += 1
            return
        at, captured_at = map(self._clock.nanoseconds, (now, frame.captured_at))
        image = frame.image.copy()
        journal.images.append((self._index, at, captured_at, image, self.image_format))

    def measurement(self, now: float, measurement: Measurement, report: Report) -> None:
        """Record an update by another sensor, after the tick whose sample has the measurement.

        Args:
            now: Time of that sample [s].
            measurement: The measurement; it is copied.
            report: Result of the update.
        """
        self._updates += 1
        copy = deepcopy(measurement)
        self._enqueue(now, self._codec.update, now, copy, report, self._updates)

    def event(self, now: float, request: str) -> None:
        """Record a request of the operator or the rig to the loop, at a rig time [s].

        In your own loop: ``loop.on_event = lambda request: log.event(sample.time, request)``.
        """
        self._enqueue(now, msg.request_messages, request)

    def warn(self, text: str) -> None:
        """Record a warning."""
        self._journal.warnings.append(text)

    @property
    def has_begun(self) -> bool:
        """Whether there was a control tick."""
        return self._ticks > 0

    @property
    def dropped(self) -> int:
        """Number of ticks, updates, requests and images dropped so far."""
        return self._journal.dropped + self._journal.dropped_images

    @property
    def failure(self) -> str:
        """Why recording stopped; empty while it works."""
        return self._journal.failure

    def close(self) -> LogSummary:
        """Write the queues, finish the file and return its summary. May be called twice."""
        journal = self._journal
        journal.close(self._settings.close_timeout)
        losses = journal.dropped, journal.dropped_images, journal.failure
        return LogSummary(journal.path, dict(journal.written), self._ticks, self._updates, *losses)

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is not None:
            ended = f"the run ended with {type(error).__name__}: {error}"
            self.warn("; ".join([_ENDS.get(type(error), ended), *notes(error)]))
        self.close()

    def _enqueue(self, now: float, encode: Callable[..., msg.Messages], *arguments: Any) -> bool:
        """Queue what a thread encodes: a function of the clock and of arguments."""
        journal = self._journal
        if not self._index:
            self._clock = msg.Clock(now, time.time_ns())
        self._index += 1
        if not self._has_room(journal.events, self._settings.queue_events):
            journal.dropped += 1
            return False
        messages = partial(encode, self._clock, *arguments)
        journal.events.append((self._index, self._clock.nanoseconds(now), messages))
        return True

    def _has_room(self, queue: deque[Any], limit: int) -> bool:
        while self._wait and len(queue) >= limit and not self._journal.done.is_set():
            time.sleep(POLL_PERIOD)
        return len(queue) < limit and not self._journal.done.is_set()
