"""A CAN bus between the processes of one computer.

`Hub` forwards the frames of each station to all others, in order and without an echo. `LocalBus` is
a station: the python-can interface ``tautscope``, for every tool of python-can, such as
``python -m can.viewer -i tautscope -c /tmp/bench.can``.

A frame on the socket has the 16 bytes of SocketCAN's ``struct can_frame``: identifier with flags
(u32), length (u8), three unused bytes, eight data bytes.
"""

import os
import selectors
import socket
import struct
import threading
import time
from pathlib import Path
from typing import Any, Self

import can

FRAME = struct.Struct("=IB3x8s")
EXTENDED, REMOTE, ERROR = 1 << 31, 1 << 30, 1 << 29
BACKLOG = 1 << 20
"""Number of unread bytes at which a station is disconnected."""


class LocalBus(can.BusABC):
    """A station on a `Hub`.

    Args:
        channel: Path of the hub's socket.
        **options: Options of python-can's buses; ``bitrate`` has no effect.

    Raises:
        can.CanInitializationError: There is no hub.
    """

    def __init__(self, channel: str, **options: Any) -> None:
        self._buffer = bytearray()
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._socket.connect(str(channel))
        except OSError as error:
            self._socket.close()
            self._is_shutdown = True
            raise can.CanInitializationError(f"no bus at {channel}: {error}") from error
        self._poll = selectors.DefaultSelector()
        self._poll.register(self._socket, selectors.EVENT_READ)
        self.channel_info = f"tautscope {channel}"
        options.pop("bitrate", None)
        super().__init__(channel=channel, **options)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; `can.CanOperationError` if the hub is closed."""
        identifier = msg.arbitration_id
        identifier |= EXTENDED if msg.is_extended_id else 0
        identifier |= REMOTE if msg.is_remote_frame else 0
        try:
            self._socket.sendall(FRAME.pack(identifier, msg.dlc, bytes(msg.data)))
        except OSError as error:
            raise can.CanOperationError(f"the bus is closed: {error}") from error

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if len(self._buffer) < FRAME.size:
            try:
                if not self._poll.select(timeout):
                    return None, False
                data = self._socket.recv(4096)
            except OSError as error:
                raise can.CanOperationError(f"the bus is closed: {error}") from error
            if not data:
                raise can.CanOperationError("the bus is closed: its hub ended")
            self._buffer += data
            if len(self._buffer) < FRAME.size:
                return None, False
        identifier, length, data = FRAME.unpack_from(self._buffer)
        del self._buffer[: FRAME.size]
        message = can.Message(
            timestamp=time.time(),
            arbitration_id=identifier & 0x1FFF_FFFF,
            is_extended_id=bool(identifier & EXTENDED),
            is_remote_frame=bool(identifier & REMOTE),
            is_error_frame=bool(identifier & ERROR),
            dlc=length,
            data=None if identifier & REMOTE else data[:length],
        )
        return message, False

    def fileno(self) -> int:
        """The socket's file descriptor."""
        return self._socket.fileno()

    def shutdown(self) -> None:
        """Leave the bus; a second call does nothing."""
        super().shutdown()
        self._poll.close()
        self._socket.close()


class Hub:
    """The bus between stations: a thread that forwards frames.

    Its socket replaces that of a hub that has ended.

    Raises:
        OSError: The socket cannot be made, or a running hub uses it.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self._server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            self._bind()
            self._server.listen()
        except BaseException:
            self._server.close()
            raise
        self._stations: dict[socket.socket, bytearray] = {}
        self._stop_receiver, self._stop_sender = socket.socketpair()
        self._selector = selectors.DefaultSelector()
        for endpoint in (self._server, self._stop_receiver):
            endpoint.setblocking(False)
            self._selector.register(endpoint, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._run, name="CAN hub", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Disconnect all stations and remove the socket; a second call does nothing."""
        if self._thread.is_alive():
            self._stop_sender.send(b"!")
            self._thread.join()
        if self._server.fileno() >= 0:
            self._selector.close()
            for endpoint in (self._server, self._stop_receiver, self._stop_sender, *self._stations):
                endpoint.close()
            self._stations.clear()
            self.path.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()

    def _bind(self) -> None:
        if self.path.is_socket():
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
                try:
                    probe.connect(str(self.path))
                except ConnectionRefusedError:
                    self.path.unlink()
        self._server.bind(str(self.path))

    def _run(self) -> None:
        while True:
            for key, _ in self._selector.select():
                endpoint = key.fileobj
                if endpoint is self._stop_receiver:
                    return
                if endpoint is self._server:
                    station, _ = self._server.accept()
                    station.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BACKLOG)
                    station.setblocking(False)
                    self._stations[station] = bytearray()
                    self._selector.register(station, selectors.EVENT_READ)
                elif isinstance(endpoint, socket.socket) and endpoint in self._stations:
                    self._forward(endpoint)

    def _forward(self, station: socket.socket) -> None:
        buffer = self._stations[station]
        try:
            data = station.recv(4096)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._disconnect(station)
            return
        buffer += data
        whole = len(buffer) - len(buffer) % FRAME.size
        frames = bytes(buffer[:whole])
        del buffer[:whole]
        for other in [other for other in self._stations if other is not station]:
            try:
                taken = other.send(frames)
            except OSError:
                taken = -1
            if taken != len(frames):
                self._disconnect(other)

    def _disconnect(self, station: socket.socket) -> None:
        self._selector.unregister(station)
        del self._stations[station]
        station.close()
