"""The log of a run, written while it goes on, by threads of its own.

The loop only puts references into bounded queues: no encoding, no lock, no file. What does not fit
is dropped and counted; a disk that fails ends the recording, never the run.
"""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from tautscope.config import Config
from tautscope.log import messages as msg
from tautscope.log.journal import LOOK_PERIOD, Journal
from tautscope.loop.reduction import Report
from tautscope.loop.references import Segment
from tautscope.loop.rig import Frame, Sample


@dataclass(frozen=True, slots=True)
class LogSummary:
    """What is in a log, and what is not.

    Attributes:
        path: The file.
        messages: Topic -> how many were written.
        ticks: Control ticks given to the log.
        updates: Image updates given to it.
        dropped: Ticks, updates and events it could not take.
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


def _say(text: str) -> None:
    print(f"warning: {text}", file=sys.stderr, flush=True)


class LogWriter:
    """Writes an MCAP file; a context manager.

    `tick`, `frame` and `event` are called by the loop, in the order of the loop's own calls; that
    order is in the file as the messages' sequence number, one per tick, update or event, from 1 on.

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
        self._settings = config.recording
        self._wait = wait
        self._ticks = self._updates = self._index = 0
        facts = msg.Facts(config, compensate, tuple(segments))
        self._journal = Journal(Path(path), facts, say)

    def tick(
        self,
        sample: Sample,
        reference: Iterable[float],
        command: Iterable[float],
        made_at: float | None = None,
    ) -> None:
        """One control tick: the sample before it, reference u (3,) and command c (3,).

        With when the reference was made, if the loop was told.
        """
        self._begin(sample.time)
        self._ticks += 1
        # Copies: the caller may use its arrays again before they are written.
        truth = None if sample.true_state is None else np.array(sample.true_state)
        kept = Sample(sample.time, np.array(sample.applied), None, truth)
        self._put(sample.time, (kept, np.array(reference), np.array(command), made_at))

    def frame(self, now: float, frame: Frame, report: Report) -> None:
        """One image update, after the tick in whose sample the frame came.

        Args:
            now: That sample's time [s].
            frame: The frame; its image is copied, a rig may use the memory again.
            report: What the loop made of it.
        """
        self._begin(now)
        self._updates += 1
        about = Frame(np.empty(0, np.uint8), frame.captured_at, frame.sequence, frame.true_features)
        if not self._put(now, (now, about, report)):
            return
        journal = self._journal
        if not self._has_room(journal.images, self._settings.queue_images):
            journal.dropped_images += 1
            return
        journal.images.append((self._index, now, frame.captured_at, frame.image.copy()))

    def event(self, now: float, what: str) -> None:
        """What the operator or the rig told the loop, at a time of the rig's clock [s].

        In a loop of your own: ``loop.on_event = lambda what: log.event(sample.time, what)``.
        """
        self._begin(now)
        self._put(now, (what,))

    def warn(self, text: str, now: float | None = None) -> None:
        """Something a person who reads the log should know, at a time of the rig's clock [s]."""
        self._journal.texts.append((now, text))

    @property
    def dropped(self) -> int:
        """Ticks, updates and images that could not be taken, up to now."""
        return self._journal.dropped + self._journal.dropped_images

    @property
    def failure(self) -> str:
        """Why nothing is recorded any more; empty while it is."""
        return self._journal.failure

    def close(self) -> LogSummary:
        """Write what waits, end the file, and say what is in it. May be called twice."""
        journal = self._journal
        journal.end(self._settings.close_timeout)
        return LogSummary(
            journal.path,
            dict(journal.written),
            self._ticks,
            self._updates,
            journal.dropped,
            journal.dropped_images,
            journal.failure,
        )

    def __enter__(self) -> LogWriter:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if error is not None:
            self.warn(f"the run ended with {type(error).__name__}: {error}")
        self.close()

    def _begin(self, now: float) -> None:
        if self._journal.clock is None:
            self._journal.clock = msg.Clock(now, time.time_ns())

    def _put(self, now: float, facts: tuple[Any, ...]) -> bool:
        journal = self._journal
        self._index += 1
        if not self._has_room(journal.events, self._settings.queue_events):
            journal.dropped += 1
            return False
        journal.events.append((self._index, now, facts))
        return True

    def _has_room(self, queue: deque[Any], limit: int) -> bool:
        while self._wait and len(queue) >= limit and not self._journal.is_done:
            time.sleep(LOOK_PERIOD)
        return len(queue) < limit and not self._journal.is_done
