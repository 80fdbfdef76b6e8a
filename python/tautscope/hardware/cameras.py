"""A live camera: one thread reads it, the loop takes the newest frame and never waits."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from threading import Event, Lock, Thread

import numpy as np

from tautscope.config import CameraConfig
from tautscope.errors import CameraError, CameraMismatchError
from tautscope.hardware.stream_clock import JUMP, StreamClock
from tautscope.hardware.video import Decoder, Image, Picture, opened
from tautscope.loop.rig import Frame

TEST_FRAMES = 8
"""How many frames the self-test looks at."""

_LIVE = {"fflags": "nobuffer"}
"""FFmpeg's options for every source: what is read to learn its format is not shown late."""
_OLDEST = 1.0
"""A frame that arrives later after its capture has another clock's time stamp [s]."""


@dataclass(frozen=True, slots=True)
class Capture:
    """A frame as the camera's thread got it.

    Attributes:
        frame: With its time of capture, and its number: a gap is a frame that was lost on the way,
            or that nobody took before the next one came.
        arrived_at: When it was decoded [s, the same clock].
    """

    frame: Frame
    arrived_at: float


@dataclass(frozen=True, slots=True)
class CameraState:
    """How a camera is doing.

    Attributes:
        received: Frames that arrived; of an interlaced source, fields.
        lost: Frames the source's time stamps say are missing.
        skipped: Frames replaced by a newer one before they were taken.
        reconnects: How often the source was opened again.
        is_interlaced: Whether frames are made of fields; None before the first one.
        age: Time since the last arrival [s]; infinite before the first.
        trouble: Why no frames come, and what to do; empty if they do.
    """

    received: int = 0
    lost: int = 0
    skipped: int = 0
    reconnects: int = 0
    is_interlaced: bool | None = None
    age: float = float("inf")
    trouble: str = ""


class Camera:
    """A live camera of the configured source; a context manager.

    Entering it opens the source and tests it: frames come, of the calibrated size, not black, and
    each another. A source that is lost later is opened again until it is back; `state` says so
    meanwhile. Frames of another size are refused.

    Args:
        config: Size, pixel format and source.
        clock: The rig's clock [s]; with ``source.clock = "device"``, the system's monotonic one.

    An interlaced source gives its fields, each a frame, one frame late (20 to 40 ms at 25 frames
    per second); their capture times are right all the same.
    """

    def __init__(self, config: CameraConfig, clock: Callable[[], float] = time.monotonic) -> None:
        self._config = config
        self._source = config.source
        self._clock = clock
        self._lock = Lock()
        self._slot: Capture | None = None
        self._state = CameraState()
        self._error: CameraError | None = None
        self._arrived_at = float("-inf")
        self._sequence = 0
        self._first: list[Capture] = []
        self._is_tested, self._is_closing = Event(), Event()
        self._thread = Thread(target=self._work, name="camera", daemon=True)

    def open(self) -> None:
        """Start the thread and test the first frames.

        Raises:
            CameraError: The source does not open, or what it gives cannot be used; it is closed.
        """
        self._thread.start()
        self._is_tested.wait(self._source.start_timeout)
        try:
            if len(self._first) < TEST_FRAMES and self._error is not None:
                raise self._error
            check_captures(self._first, self._config)
        except CameraError:
            self.close()
            raise

    def newest(self) -> Capture | None:
        """The newest frame that was not taken yet, or None. Does not wait for the camera."""
        with self._lock:
            taken, self._slot = self._slot, None
        return taken

    @property
    def state(self) -> CameraState:
        """How the camera is doing now."""
        with self._lock:
            state = replace(self._state, age=self._clock() - self._arrived_at)
        if not state.trouble and state.age > self._source.timeout:
            trouble = f"no frame for {state.age:.1f} s; is the camera on and connected?"
            return replace(state, trouble=trouble)
        return state

    def close(self) -> None:
        """Release the camera. May be called twice."""
        self._is_closing.set()
        if self._thread.is_alive():
            self._thread.join(self._source.timeout)

    def __enter__(self) -> Camera:
        self.open()
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()

    def _work(self) -> None:
        """The thread: open, read, and again."""
        source = self._source
        while not self._is_closing.is_set():
            is_in_vain = False
            try:
                options = _LIVE | source.options
                with opened(source.url, source.format, options, source.timeout) as container:
                    self._read(Decoder(container, self._config, live=True))
                trouble = f"{source.url} has ended; it is opened again"
            except CameraError as error:
                self._error, trouble = error, str(error)
                is_in_vain = isinstance(error, CameraMismatchError)
            except Exception as error:  # a thread that dies in silence would look like no news
                trouble = f"{source.url}: {type(error).__name__}: {error}"
                self._error = CameraError("camera.source", trouble, "frames")
            with self._lock:
                self._state = replace(self._state, trouble=trouble)
            if is_in_vain:
                self._is_tested.set()
            if not self._is_closing.wait(source.reconnect_period):
                with self._lock:
                    self._state = replace(self._state, reconnects=self._state.reconnects + 1)

    def _read(self, decoder: Decoder) -> None:
        stream_clock, last = StreamClock(self._source), None
        for picture in decoder:
            if self._is_closing.is_set():
                return
            arrived_at = self._clock()
            captured_at = stream_clock.captured_at(picture.stamp, arrived_at)
            self._deliver(picture, captured_at, arrived_at, _gap(last, picture, decoder), decoder)
            last = picture.stamp

    def _deliver(
        self, picture: Picture, captured_at: float, arrived_at: float, lost: int, decoder: Decoder
    ) -> None:
        self._sequence += lost
        frame = Frame(picture.image, captured_at, self._sequence)
        self._sequence += 1
        capture = Capture(frame, arrived_at)
        with self._lock:
            state = self._state
            self._state = replace(
                state,
                received=state.received + 1,
                lost=state.lost + lost,
                skipped=state.skipped + (self._slot is not None),
                is_interlaced=decoder.is_interlaced,
                trouble="",
            )
            self._slot = capture
            self._arrived_at = arrived_at
        if not self._is_tested.is_set():
            self._first.append(capture)
            if len(self._first) == TEST_FRAMES:
                self._is_tested.set()


def _gap(last: float | None, picture: Picture, decoder: Decoder) -> int:
    """How many pictures are missing before this one, by the source's time stamps."""
    period = decoder.period
    if last is None or picture.stamp is None or period is None:
        return 0
    step = picture.stamp - last
    return max(round(step / period) - 1, 0) if 0 < step <= JUMP else 0


def check_captures(captures: Sequence[Capture], config: CameraConfig) -> None:
    """The self-test: whether a camera's first frames can be used.

    Raises:
        CameraError: Too few, black, all the same, or of another clock; it says what to do.
    """
    source = config.source
    if len(captures) < TEST_FRAMES:
        raise CameraError(
            "camera.source",
            f"{len(captures)} frames in {source.start_timeout:g} s",
            f"at least {TEST_FRAMES}; is the camera on, connected, and used by nobody else?",
        )
    images = [capture.frame.image for capture in captures]
    brightest = max(int(_brightness(image, config).max()) for image in images)
    if brightest <= source.darkest:
        raise CameraError(
            "camera.source",
            f"black pictures, brightest pixel {brightest}",
            f"one above camera.source.darkest = {source.darkest}; is the light on, the cap off, "
            "the right input chosen?",
        )
    pairs = list(pairwise(captures))
    if all(np.array_equal(one.frame.image, two.frame.image) for one, two in pairs):
        raise CameraError(
            "camera.source",
            f"{len(captures)} times the same picture",
            "pictures that differ at least in noise; is the video processor frozen, or showing a "
            "menu or a test card?",
        )
    if any(two.frame.captured_at <= one.frame.captured_at for one, two in pairs):
        raise CameraError(
            "camera.source",
            "time stamps that stand still or run back",
            'time stamps that rise; camera.source.clock = "arrival" does without them',
        )
    late = [capture.arrived_at - capture.frame.captured_at for capture in captures]
    if not 0 <= min(late) <= max(late) <= _OLDEST:
        worst = max(late, key=abs)
        raise CameraError(
            "camera.source.clock",
            f"frames captured {worst:.3g} s before they arrived",
            f'0 to {_OLDEST:g} s; is {source.clock} the right clock? "stream" works for most',
        )


def _brightness(image: Image, config: CameraConfig) -> Image:
    """The bytes that say how bright it is."""
    place = {"yuyv": 0, "uyvy": 1}.get(config.pixel_format)
    if place is not None:
        return image[..., place]
    return image[: config.height] if image.ndim == 2 else image[..., :3]
