"""A live camera: a thread reads frames, and the loop takes the newest one without waiting."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from threading import Event, Lock, Thread

import numpy as np

from tautscope.config import CameraConfig
from tautscope.errors import CameraError, CameraMismatchError, NoRigError
from tautscope.hardware.stream_clock import JUMP, StreamClock
from tautscope.hardware.video import DecodedFrame, Decoder, open_source
from tautscope.loop.frame_layout import brightness
from tautscope.loop.rig import Frame

TEST_FRAMES = 8
"""Number of frames in the self-test."""

_LIVE = {"fflags": "nobuffer"}
"""FFmpeg options of every source: do not buffer frames read to detect the format."""
_MAX_AGE = 1.0
"""A frame with a larger age at arrival has the time stamp of another clock [s]."""


@dataclass(frozen=True, slots=True)
class Capture:
    """A frame and its time of arrival.

    Attributes:
        frame: With capture time and sequence number; gaps are frames that were lost, or replaced by
            a newer one before they were taken.
        arrived_at: When it was decoded [s, the clock of the capture time].
    """

    frame: Frame
    arrived_at: float


@dataclass(slots=True)
class CameraState:
    """State of a camera.

    Attributes:
        received: Frames received; fields of an interlaced source.
        lost: Frames missing according to the time stamps.
        skipped: Frames replaced by a newer one before they were taken.
        damaged: Frames that could not be decoded whole since the source was opened.
        reconnects: How often the source was opened again.
        is_interlaced: Whether the source is interlaced; None before the first frame.
        age: Time since the last arrival [s]; infinite before the first.
        trouble: Why no frames arrive, and what to do; empty if they arrive.
    """

    received: int = 0
    lost: int = 0
    skipped: int = 0
    damaged: int = 0
    reconnects: int = 0
    is_interlaced: bool | None = None
    age: float = float("inf")
    trouble: str = ""


class Camera:
    """A live camera; a context manager.

    Entering it opens the source and tests it: frames arrive, have the calibrated size, are not
    black, and differ. A source that is lost later is reopened until it is back; `state` reports the
    problem meanwhile.

    Args:
        config: Size, pixel format and source.
        clock: The rig's clock [s]; with ``source.clock = "device"``, the system's monotonic one.

    Each field of an interlaced source becomes a frame. Deinterlacing delays it by one frame, 20 to
    40 ms at 25 frames per second; its capture time is correct.
    """

    def __init__(self, config: CameraConfig, clock: Callable[[], float] = time.monotonic) -> None:
        self._config = config
        self._source = config.source
        self._clock = clock
        self._lock = Lock()
        self._newest: Capture | None = None
        self._state = CameraState()
        self._error: CameraError | None = None
        self._arrived_at = float("-inf")
        self._sequence = 0
        self._test_captures: list[Capture] = []
        self._is_tested, self._is_closing = Event(), Event()
        self._thread = Thread(target=self._run, name="camera", daemon=True)

    def open(self) -> None:
        """Start the thread and test the first frames.

        Raises:
            CameraError: The source does not open, or its frames cannot be used; it is closed.
        """
        url = self._source.url
        if url.startswith("unix:") and not Path(url.removeprefix("unix:")).exists():
            raise NoRigError("camera.source.url", url, "a running bench")
        self._thread.start()
        self._is_tested.wait(self._source.start_timeout)
        try:
            if len(self._test_captures) < TEST_FRAMES and self._error is not None:
                raise self._error
            check_first_frames(self._test_captures, self._config)
        except CameraError:
            self.close()
            raise

    def newest(self) -> Capture | None:
        """The newest frame not taken before, or None; does not wait for the camera."""
        with self._lock:
            taken, self._newest = self._newest, None
        return taken

    @property
    def state(self) -> CameraState:
        """State of the camera."""
        with self._lock:
            state = replace(self._state, age=self._clock() - self._arrived_at)
        if not state.trouble and state.age > self._source.timeout:
            state.trouble = f"no frame for {state.age:.1f} s; is the camera on and connected?"
        return state

    def close(self) -> None:
        """Release the camera; a second call does nothing."""
        self._is_closing.set()
        if self._thread.is_alive():
            self._thread.join(self._source.timeout)

    def __enter__(self) -> Camera:
        self.open()
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()

    def _run(self) -> None:
        """Open the source, read it until it ends or fails, and repeat."""
        source = self._source
        while not self._is_closing.is_set():
            is_permanent = False
            try:
                options = _LIVE | source.options
                with open_source(
                    source.url, source.format or None, options, source.timeout
                ) as container:
                    self._read(Decoder(container, self._config))
                trouble = f"{source.url} has ended and is opened again"
            except CameraError as error:
                self._error, trouble = error, str(error)
                is_permanent = isinstance(error, CameraMismatchError)
            except Exception as error:  # an error that ends the thread must become visible
                trouble = f"{source.url}: {type(error).__name__}: {error}"
                self._error = CameraError("camera.source", trouble, "frames")
            with self._lock:
                self._state.trouble = trouble
            if is_permanent:
                self._is_tested.set()
            if not self._is_closing.wait(source.reconnect_period):
                with self._lock:
                    self._state.reconnects += 1

    def _read(self, decoder: Decoder) -> None:
        stream_clock, last = StreamClock(self._source), None
        for decoded in decoder:
            if self._is_closing.is_set():
                return
            arrived_at = self._clock()
            captured_at = stream_clock.captured_at(decoded.stamp, arrived_at)
            lost, last = _lost_frames(last, decoded, decoder), decoded.stamp
            self._sequence += lost
            frame = Frame(decoded.image, captured_at, self._sequence)
            self._sequence += 1
            capture = Capture(frame, arrived_at)
            with self._lock:
                state = self._state
                state.received += 1
                state.lost += lost
                state.skipped += self._newest is not None
                state.damaged, state.is_interlaced = decoder.damaged, decoder.is_interlaced
                state.trouble = ""
                self._newest, self._arrived_at = capture, arrived_at
            if not self._is_tested.is_set():
                self._test_captures.append(capture)
                if len(self._test_captures) == TEST_FRAMES:
                    self._is_tested.set()


def _lost_frames(last: float | None, decoded: DecodedFrame, decoder: Decoder) -> int:
    """Number of frames missing before this one, according to the time stamps."""
    period = decoder.period
    if last is None or decoded.stamp is None or period is None:
        return 0
    step = decoded.stamp - last
    return max(round(step / period) - 1, 0) if 0 < step <= JUMP else 0


def check_first_frames(captures: Sequence[Capture], config: CameraConfig) -> None:
    """Test whether the first frames of a camera can be used.

    Raises:
        CameraError: There are too few, all are black or equal, or their time stamps are wrong.
    """
    source = config.source
    if len(captures) < TEST_FRAMES:
        raise CameraError(
            "camera.source",
            f"{len(captures)} frames in {source.start_timeout:g} s",
            f"at least {TEST_FRAMES}; is the camera on, connected, and used by no other program?",
        )
    bright = (brightness(each.frame.image, config.pixel_format) for each in captures)
    brightest = max(int(part.max()) for part in bright)
    if brightest <= source.darkest:
        raise CameraError(
            "camera.source",
            f"black images, brightest pixel {brightest}",
            f"a pixel above camera.source.darkest = {source.darkest}; is the light on, the lens "
            "cap off, the right input selected?",
        )
    pairs = list(pairwise(captures))
    if all(np.array_equal(one.frame.image, two.frame.image) for one, two in pairs):
        raise CameraError(
            "camera.source",
            f"{len(captures)} equal images",
            "images that differ at least by noise; is the video processor frozen, or does it show "
            "a menu or a test pattern?",
        )
    if any(two.frame.captured_at <= one.frame.captured_at for one, two in pairs):
        raise CameraError(
            "camera.source",
            "time stamps that do not increase",
            'increasing time stamps; camera.source.clock = "arrival" ignores them',
        )
    ages = [capture.arrived_at - capture.frame.captured_at for capture in captures]
    if not 0 <= min(ages) <= max(ages) <= _MAX_AGE:
        worst = max(ages, key=abs)
        raise CameraError(
            "camera.source.clock",
            f"frames captured {worst:.3g} s before they arrived",
            f'0 to {_MAX_AGE:g} s; is {source.clock} the right clock? "stream" suits most sources',
        )
