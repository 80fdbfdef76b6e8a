"""The twin's camera as a stream in real time: uncompressed pictures in NUT on a Unix socket.

Time stamps are the instants of capture on the computer's monotonic clock, as V4L2 gives them, to
the microsecond: ``camera.source`` with format ``nut`` and clock ``device`` reads them as they are.
"""

from __future__ import annotations

import queue
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Literal, Self, get_args

import av
import numpy as np
from av.container import OutputContainer
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.errors import ConfigError
from tautscope.hardware.realtime import OTHERS, step_back
from tautscope.twin.camera import TwinCamera

CameraFault = Literal["drop", "delay", "fault", "freeze"]
"""drop: no frames. delay: every frame later. fault: unplugged. freeze: the same picture for ever,
with new time stamps."""

Centreline = tuple[NDArray[np.float64], NDArray[np.float64]]
_MICROSECOND = Fraction(1, 1_000_000)
_WAITING = 4
"""Captures that may wait to be drawn; on a slower computer, older ones are dropped."""
_PATIENCE = 0.5
"""How long a client may take a picture [s] before it is disconnected."""
_LOOK_PERIOD = 0.02
"""How often the thread looks for clients and faults [s]."""


class CameraStream:
    """Draws, delays and sends; a thread, one client at a time.

    Args:
        config: Camera, instrument, twin.
        path: Where the socket is made.
        look: The centreline now, for pictures while nobody calls `capture`.
        timing: Draws the latencies.
    """

    def __init__(
        self,
        config: Config,
        path: str,
        look: Callable[[], Centreline],
        timing: np.random.Generator,
    ) -> None:
        self._config = config
        self._camera = TwinCamera(config)
        self._path = Path(path)
        self._look = look
        self._random = timing
        self._period = 1 / config.twin.frame_rate
        self._captures: queue.Queue[tuple[float, Centreline]] = queue.Queue(_WAITING)
        self._under_way: deque[tuple[float, float, NDArray[np.uint8]]] = deque()
        self._due = time.monotonic()
        self._sequence = 0
        self._faults: dict[CameraFault, float] = {}
        self._still: NDArray[np.uint8] | None = None
        self._server: socket.socket | None = None
        self._client: _Client | None = None
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bench camera", daemon=True)

    @property
    def is_due(self) -> bool:
        """Whether it is time for a picture."""
        return time.monotonic() >= self._due

    def capture(self, at: float, centreline: Centreline) -> None:
        """Take a picture: the instrument as it was at an instant of the monotonic clock [s]."""
        self._due = max(self._due, at - self._period) + self._period
        with suppress(queue.Full):
            self._captures.put_nowait((at, centreline))

    def inject(self, kind: CameraFault, delay: float = 0.3) -> None:
        """Ask for a fault; `delay` [s] is that of ``delay``.

        Raises:
            ConfigError: No such fault.
        """
        if kind not in get_args(CameraFault):
            raise ConfigError("fault", kind, "one of " + ", ".join(get_args(CameraFault)))
        self._faults = self._faults | {kind: delay}

    def clear(self) -> None:
        """End the faults."""
        self._faults = {}

    def __enter__(self) -> Self:
        try:
            self._listen()
        except OSError as error:
            allowed = f"unix:PATH of a socket that can be made ({error})"
            raise ConfigError("camera.source.url", f"unix:{self._path}", allowed) from None
        self._thread.start()
        return self

    def __exit__(self, *failure: object) -> None:
        self._ending.set()
        self._thread.join()
        self._unplug()

    def _run(self) -> None:
        step_back(OTHERS)  # drawing takes longer than a cycle may wait
        while not self._ending.is_set():
            if "fault" in self._faults:
                self._unplug()
            else:
                self._accept()
            due = self._due + self._period
            if self._under_way:
                due = min(due, self._under_way[0][0])
            patience = min(due - time.monotonic(), _LOOK_PERIOD)
            try:
                self._draw(*self._captures.get(timeout=max(patience, 0.0)))
            except queue.Empty:
                self._idle()
            while self._under_way and self._under_way[0][0] <= time.monotonic():
                _, at, image = self._under_way.popleft()
                self._send(at, image)

    def _idle(self) -> None:
        """The motors are off, and nobody captures: the instrument is still seen."""
        now = time.monotonic()
        if now >= self._due + self._period:
            self.capture(now, self._look())

    def _draw(self, at: float, centreline: Centreline) -> None:
        twin, faults = self._config.twin, self._faults
        image = self._camera.draw(*centreline, self._sequence).image
        self._sequence += 1
        delay = twin.latency + twin.latency_jitter * self._random.uniform(-1, 1)
        if "freeze" in faults:
            self._still = image if self._still is None else self._still
            image = self._still
        else:
            self._still = None
        if "drop" not in faults:
            self._under_way.append((at + delay + faults.get("delay", 0.0), at, image))

    def _listen(self) -> socket.socket:
        self._path.unlink(missing_ok=True)
        server = socket.socket(socket.AF_UNIX)
        try:
            server.bind(str(self._path))
        except OSError:
            server.close()
            raise
        server.listen()
        server.setblocking(False)
        self._server = server
        return server

    def _accept(self) -> None:
        server = self._listen() if self._server is None else self._server
        try:
            connection, _ = server.accept()
        except BlockingIOError:
            return
        if self._client is not None:
            self._client.close()
        camera = self._config.camera
        self._client = _Client(connection, camera.width, camera.height, self._config)

    def _send(self, at: float, image: NDArray[np.uint8]) -> None:
        if self._client is None:
            return
        try:
            self._client.send(at, image)
        except (OSError, av.error.FFmpegError):  # gone, or too slow
            self._client.close()
            self._client = None

    def _unplug(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
        if self._server is not None:
            self._server.close()
            self._server = None
            self._path.unlink(missing_ok=True)


class _Client:
    """One connection, with a NUT stream of its own."""

    def __init__(self, connection: socket.socket, width: int, height: int, config: Config) -> None:
        connection.settimeout(_PATIENCE)
        self._connection = connection
        self._is_gone = False
        self._container: OutputContainer = av.open(
            self, "w", format="nut", options={"fflags": "flush_packets"}
        )
        rate = Fraction(config.twin.frame_rate).limit_denominator(1001)
        self._stream = self._container.add_stream("rawvideo", rate=rate)
        self._stream.width, self._stream.height = width, height
        self._stream.pix_fmt = "bgr24"
        self._stream.time_base = self._stream.codec_context.time_base = _MICROSECOND

    def send(self, at: float, image: NDArray[np.uint8]) -> None:
        frame = av.VideoFrame.from_ndarray(image, format="bgr24")
        frame.pts, frame.time_base = round(at * 1e6), _MICROSECOND
        for packet in self._stream.encode(frame):
            self._container.mux(packet)
        if self._is_gone:
            raise ConnectionError

    def write(self, data: bytes) -> int:
        """For FFmpeg, to whom an error raised here means nothing."""
        if not self._is_gone:
            try:
                self._connection.sendall(data)
            except OSError:
                self._is_gone = True
        return len(data)

    def close(self) -> None:
        self._is_gone = True
        self._container.close()
        self._connection.close()
