"""The web server: pages, commands, states and images, in a process of its own.

Commands are checked for their form here and for everything else in the control process. This
process cannot move anything by itself: without fresh commands motion stops.
"""

import asyncio
import hmac
import signal
import time
from collections.abc import AsyncIterator, Callable
from http import HTTPStatus
from multiprocessing import parent_process
from typing import Any, TypeVar

import msgspec
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from tautscope.console import messages as msg
from tautscope.console.feeds import ImageFeed, StateFeed
from tautscope.console.pages import Pages
from tautscope.console.shared import Channels, SharedMemory

CONTROL, VIDEO = "/control", "/video"
POLICY_VIOLATION = 1008
ADDRESS = "127.0.0.1"
LARGEST_CONNECTIONS = 24
"""Connections at most, with those that have not sent their token."""
TOKEN_TIME = 2.0
"""Time within which a connection has to send the token [s]."""
RATE, BURST = 150.0, 450.0
"""Messages per second of one connection on average, and at once."""
Message = TypeVar("Message")


class RateLimit:
    """A token bucket: `BURST` messages at once, refilled by `RATE` per second."""

    def __init__(self, now: float) -> None:
        self._left, self._at = BURST, now

    def allows(self, now: float) -> bool:
        """Whether a message is allowed at a time [s]; counts it."""
        self._left = min(BURST, self._left + (now - self._at) * RATE)
        self._at = now
        if self._left < 1:
            return False
        self._left -= 1
        return True


def run_server(memory: SharedMemory, token: str, sockets: list[Any]) -> None:
    """Serve until the control process ends; the target of the server's process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the control process, then this one
    server = Server(Channels(memory), memory, token, sockets[0].getsockname()[1])
    asyncio.run(server.run(sockets[0]))


class Server:
    """Serves the page on one port, to those who know the token."""

    def __init__(self, channels: Channels, memory: SharedMemory, token: str, port: int) -> None:
        self._channels, self._token = channels, token.encode()
        self._hosts = [f"{name}:{port}" for name in (ADDRESS, "localhost")]
        self._origins = [f"http://{host}" for host in self._hosts]
        self._pages = Pages(self._hosts)
        self._images = ImageFeed(channels.images, memory.pixel_format)
        self._states = StateFeed(channels, memory.layout, lambda: self._images.latency)
        self._connections = self._clients = 0

    async def run(self, listener: Any) -> None:
        """Serve connections of a bound socket until the control process ends."""
        options: dict[str, Any] = {
            "process_request": self._process_request,
            "origins": self._origins,
            "compression": None,
            "max_size": msg.LARGEST_MESSAGE,
            "max_queue": 64,
            "write_limit": 1 << 16,
            "open_timeout": TOKEN_TIME,
            "close_timeout": 1.0,
            "ping_interval": 1.0,
            "ping_timeout": 5.0,
            "server_header": None,
        }
        parent = parent_process()
        async with (
            serve(self._handle, sock=listener, **options),
            asyncio.TaskGroup() as group,  # an error of a feed ends the server
        ):
            feeding = [group.create_task(feed.run()) for feed in (self._states, self._images)]
            while parent is not None and parent.is_alive():
                await asyncio.sleep(0.05)
            for task in feeding:
                task.cancel()

    def _process_request(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer requests for pages; None lets the connection become a socket."""
        hosts = request.headers.get_all("Host")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return self._pages.plain(HTTPStatus.FORBIDDEN, "Forbidden")
        # Older versions of websockets refuse other methods themselves.
        if getattr(request, "method", "GET") != "GET":
            return self._pages.plain(HTTPStatus.METHOD_NOT_ALLOWED, "Method Not Allowed")
        if request.path not in (CONTROL, VIDEO):
            return self._pages.response(request.path)
        if self._connections >= LARGEST_CONNECTIONS:
            return self._pages.plain(HTTPStatus.SERVICE_UNAVAILABLE, "Too many connections")
        if request.headers.get("Origin") not in self._origins:
            return self._pages.plain(HTTPStatus.FORBIDDEN, "Forbidden")
        return None

    async def _handle(self, connection: ServerConnection) -> None:
        self._connections += 1
        try:
            if not await self._has_token(connection):
                await connection.close(POLICY_VIOLATION, "no token")
            elif connection.request is not None and connection.request.path == VIDEO:
                await self._serve_video(connection)
            else:
                await self._serve_control(connection)
        except ConnectionClosed:
            pass
        finally:
            self._connections -= 1

    async def _has_token(self, connection: ServerConnection) -> bool:
        try:
            async with asyncio.timeout(TOKEN_TIME):
                hello = msg.decode_hello(await connection.recv())
        except (TimeoutError, msgspec.MsgspecError, UnicodeError):
            return False
        return hmac.compare_digest(hello.token.encode(), self._token)

    async def _messages(
        self, connection: ServerConnection, decode: Callable[[str | bytes], Message]
    ) -> AsyncIterator[Message]:
        """The messages of a page; what is malformed, or too many, ends its connection."""
        limit = RateLimit(time.monotonic())
        async for data in connection:
            try:
                message = decode(data)
            except (msgspec.MsgspecError, UnicodeError):
                await connection.close(POLICY_VIOLATION, "malformed message")
                return
            if not isinstance(message, msg.Stop) and not limit.allows(time.monotonic()):
                await connection.close(POLICY_VIOLATION, "too many messages")
                return
            yield message

    async def _serve_control(self, connection: ServerConnection) -> None:
        self._clients += 1
        client, channels = self._clients, self._channels
        sending = asyncio.create_task(self._states.send(connection, client))
        try:
            async for message in self._messages(connection, msg.decode_control):
                data = msg.encode(msg.Received(client, time.monotonic(), message))
                if isinstance(message, msg.Stop):
                    channels.stop.write(data)
                elif not isinstance(message, msg.Servo):
                    channels.inbound.write(data)
                elif client == self._states.holder:
                    # The others would only overwrite the holder's; the control process checks it.
                    channels.servo.write(data)
        finally:
            channels.inbound.write(msg.encode(msg.Gone(client)))
            sending.cancel()

    async def _serve_video(self, connection: ServerConnection) -> None:
        sending = asyncio.create_task(self._images.send(connection))
        try:
            async for drawn in self._messages(connection, msg.decode_video):
                self._images.acknowledge(connection, drawn.image, drawn.width)
        finally:
            sending.cancel()
