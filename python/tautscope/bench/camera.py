"""The twin's camera as a real-time stream: uncompressed images in NUT on a Unix socket.

Time stamps are capture times of the monotonic clock in microseconds, as in V4L2; read them with
format ``nut`` and clock ``device`` in ``camera.source``.
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
from typing import Self

import av
import numpy as np
from av.container import OutputContainer
from numpy.typing import NDArray

from tautscope.bench.board import MovedBoard
from tautscope.config import Config
from tautscope.errors import ConfigError
from tautscope.hardware.realtime import OTHERS, lower_realtime_priority
from tautscope.twin.camera import TwinCamera

FAULTS = ("drop", "delay", "fault", "freeze", "board")
"""drop: no frames. delay: later frames. fault: unplugged. freeze: one image, new time stamps.
board: a calibration board in front of the lens, held still in one pose after the other."""

Centreline = tuple[NDArray[np.float64], NDArray[np.float64]]
_MICROSECOND = Fraction(1, 1_000_000)
_QUEUE_LENGTH = 4
"""Captures that can wait to be rendered; further ones are dropped."""
_SEND_TIMEOUT = 0.5
"""How long a client may take to read an image [s] before it is disconnected."""
_DELAY = 0.3
"""By how much images of the fault ``delay`` are later [s]."""
_POLL_PERIOD = 0.02
"""How often the thread checks for clients and faults [s]."""


class CameraStream:
    """A thread that renders, delays and sends images to one client of a socket at a time.

    `centreline_now` is for images while nobody calls `capture`, `timing` draws the latencies.
    """

    def __init__(
        self,
        config: Config,
        path: str,
        centreline_now: Callable[[], Centreline],
        timing: np.random.Generator,
    ) -> None:
        self._config = config
        self._camera = TwinCamera(config)
        self._path = Path(path)
        self._centreline_now = centreline_now
        self._random = timing
        self._period = 1 / config.twin.frame_rate
        self._captures: queue.Queue[tuple[float, Centreline]] = queue.Queue(_QUEUE_LENGTH)
        self._pending: deque[tuple[float, float, NDArray[np.uint8]]] = deque()
        self._due = time.monotonic()
        self._sequence = 0
        self._faults: set[str] = set()
        self._frozen_image: NDArray[np.uint8] | None = None
        self._board: MovedBoard | None = None
        self._server: socket.socket | None = None
        self._client: _Client | None = None
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bench camera", daemon=True)

    @property
    def is_due(self) -> bool:
        """Whether the next image is due."""
        return time.monotonic() >= self._due

    def capture(self, at: float, centreline: Centreline) -> None:
        """Queue an image of the instrument at a time of the monotonic clock [s]."""
        self._due = max(self._due, at - self._period) + self._period
        with suppress(queue.Full):
            self._captures.put_nowait((at, centreline))

    def inject(self, kind: str) -> None:
        """Inject a fault; ``clear`` ends all faults.

        Raises:
            ConfigError: There is no such fault.
        """
        if kind not in ("clear", *FAULTS):
            raise ConfigError("fault", kind, "one of " + ", ".join(FAULTS))
        self._faults = set() if kind == "clear" else self._faults | {kind}

    def __enter__(self) -> Self:
        try:
            self._listen()
        except OSError as error:
            allowed = f"unix:PATH of a socket that can be made ({error})"
            raise ConfigError("camera.source.url", f"unix:{self._path}", allowed) from None
        self._thread.start()
        return self

    def __exit__(self, *failure: object) -> None:
        self._stopping.set()
        self._thread.join()
        self._disconnect()

    def _run(self) -> None:
        lower_realtime_priority(OTHERS)  # rendering takes longer than a cycle
        while not self._stopping.is_set():
            if "fault" in self._faults:
                self._disconnect()
            else:
                self._accept()
            due = self._due + self._period
            if self._pending:
                due = min(due, self._pending[0][0])
            timeout = min(due - time.monotonic(), _POLL_PERIOD)
            try:
                self._render(*self._captures.get(timeout=max(timeout, 0.0)))
            except queue.Empty:
                # The instrument at rest, while the motors are off.
                now = time.monotonic()
                if now >= self._due + self._period:
                    self.capture(now, self._centreline_now())
            while self._pending and self._pending[0][0] <= time.monotonic():
                _, at, image = self._pending.popleft()
                self._send(at, image)

    def _render(self, at: float, centreline: Centreline) -> None:
        twin, faults = self._config.twin, self._faults
        if "board" in faults:
            self._board = self._board or MovedBoard(self._config)
            image = self._board.draw(at, self._sequence)
        else:
            image = self._camera.draw(*centreline, self._sequence).image
        self._sequence += 1
        delay = twin.latency + twin.latency_jitter * self._random.uniform(-1, 1)
        if "freeze" in faults:
            self._frozen_image = image if self._frozen_image is None else self._frozen_image
            image = self._frozen_image
        else:
            self._frozen_image = None
        if "drop" not in faults:
            stamp = at + twin.sensor.stamp_error
            due = max(at, stamp) + delay + (_DELAY if "delay" in faults else 0.0)
            self._pending.append((due, stamp, image))

    def _listen(self) -> socket.socket:
        if self._path.is_socket():  # no other file: it would be somebody's
            self._path.unlink()
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
        self._close_client()
        self._client = _Client(connection, self._config)

    def _send(self, at: float, image: NDArray[np.uint8]) -> None:
        if self._client is None:
            return
        try:
            self._client.send(at, image)
        except (OSError, av.error.FFmpegError):  # disconnected, or too slow
            self._close_client()

    def _close_client(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None

    def _disconnect(self) -> None:
        self._close_client()
        if self._server is not None:
            self._server.close()
            self._server = None
            self._path.unlink(missing_ok=True)


class _Client:
    def __init__(self, connection: socket.socket, config: Config) -> None:
        connection.settimeout(_SEND_TIMEOUT)
        self._connection = connection
        self._is_lost = False
        self._container: OutputContainer = av.open(
            self, "w", format="nut", options={"fflags": "flush_packets"}
        )
        rate = Fraction(config.twin.frame_rate).limit_denominator(1001)
        self._stream = self._container.add_stream("rawvideo", rate=rate)
        self._stream.width, self._stream.height = config.camera.width, config.camera.height
        self._stream.pix_fmt = "bgr24"
        self._stream.time_base = self._stream.codec_context.time_base = _MICROSECOND

    def send(self, at: float, image: NDArray[np.uint8]) -> None:
        frame = av.VideoFrame.from_ndarray(image, format="bgr24")
        frame.pts, frame.time_base = round(at * 1e6), _MICROSECOND
        for packet in self._stream.encode(frame):
            self._container.mux(packet)
        if self._is_lost:
            raise ConnectionError

    def write(self, data: bytes) -> int:
        """Called by FFmpeg, which ignores exceptions."""
        if not self._is_lost:
            try:
                self._connection.sendall(data)
            except OSError:
                self._is_lost = True
        return len(data)

    def close(self) -> None:
        self._is_lost = True
        self._container.close()
        self._connection.close()
