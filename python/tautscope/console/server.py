"""The web server: pages, commands, states and images, in a process of its own.

Commands are checked for their form here and for everything else in the control process. This
process cannot move anything by itself: without fresh commands motion stops.
"""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from http import HTTPStatus
from multiprocessing import parent_process
from typing import Any

import msgspec
from websockets.asyncio.server import Server as WebSocketServer
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from tautscope.console import messages as msg
from tautscope.console.access import (
    LARGEST_CONNECTIONS,
    LARGEST_MESSAGE,
    TOKEN_TIME,
    Access,
    RateLimit,
)
from tautscope.console.feeds import ImageFeed, StateFeed
from tautscope.console.pages import Pages
from tautscope.console.shared import Channels, SharedMemory

CONTROL, VIDEO = "/control", "/video"
POLICY_VIOLATION = 1008


def run_server(memory: SharedMemory, token: str, sockets: list[Any]) -> None:
    """Serve until the control process ends; the target of the server's process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the control process, then this one
    server = Server(Channels(memory), memory, token, sockets[0].getsockname()[1])
    asyncio.run(server.run(sockets[0]))


class Server:
    """Serves the page on one port.

    Args:
        channels: This process's views of the shared memory.
        memory: What the processes share, with the layout of the page.
        token: What a page has to know.
        port: The port.
    """

    def __init__(self, channels: Channels, memory: SharedMemory, token: str, port: int) -> None:
        self._channels = channels
        self._access = Access(token, port)
        self._pages = Pages(self._access.hosts)
        self._images = ImageFeed(channels.images, memory.pixel_format)
        self._states = StateFeed(channels, memory.layout, lambda: self._images.latency)
        self._connections = self._clients = 0

    async def run(self, listener: Any) -> None:
        """Serve connections of a bound socket until the control process ends."""
        async with self.serving(sock=listener):
            parent = parent_process()
            while parent is not None and parent.is_alive():
                await asyncio.sleep(0.05)

    @asynccontextmanager
    async def serving(self, **address: Any) -> AsyncIterator[WebSocketServer]:
        """Serve during the block."""
        options: dict[str, Any] = {
            "process_request": self._process_request,
            "origins": self._access.origins,
            "compression": None,
            "max_size": LARGEST_MESSAGE,
            "max_queue": 64,
            "write_limit": 1 << 16,
            "open_timeout": TOKEN_TIME,
            "close_timeout": 1.0,
            "ping_interval": 1.0,
            "ping_timeout": 5.0,
            "server_header": None,
        }
        async with serve(self._handle, **address, **options) as server:
            feeding = [asyncio.create_task(feed.run()) for feed in (self._states, self._images)]
            try:
                yield server
            finally:
                for task in feeding:
                    task.cancel()

    def _process_request(self, connection: ServerConnection, request: Request) -> Response | None:
        """Answer requests for pages; None lets the connection become a socket."""
        if not self._access.is_host(request.headers.get_all("Host")):
            return self._pages.plain(HTTPStatus.FORBIDDEN, "Forbidden")
        # Older versions of websockets refuse other methods themselves.
        if getattr(request, "method", "GET") != "GET":
            return self._pages.plain(HTTPStatus.METHOD_NOT_ALLOWED, "Method Not Allowed")
        if request.path not in (CONTROL, VIDEO):
            return self._pages.response(request.path)
        if self._connections >= LARGEST_CONNECTIONS:
            return self._pages.plain(HTTPStatus.SERVICE_UNAVAILABLE, "Too many connections")
        if request.headers.get("Origin") not in self._access.origins:
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
        return self._access.is_token(hello.token)

    async def _serve_control(self, connection: ServerConnection) -> None:
        self._clients += 1
        client = self._clients
        sending = asyncio.create_task(self._states.send(connection, client))
        limit = RateLimit(time.monotonic())
        try:
            async for data in connection:
                now = time.monotonic()
                try:
                    message = msg.decode_control(data)
                except (msgspec.MsgspecError, UnicodeError):
                    await connection.close(POLICY_VIOLATION, "malformed message")
                    return
                if isinstance(message, msg.Stop):
                    self._channels.stop.write(msg.encode(msg.Received(client, now, message)))
                elif not limit.allows(now):
                    await connection.close(POLICY_VIOLATION, "too many messages")
                    return
                elif isinstance(message, msg.Servo):
                    # The others would only overwrite the holder's; the control process checks it.
                    if client == self._states.holder:
                        self._channels.servo.write(msg.encode(msg.Received(client, now, message)))
                else:
                    self._channels.inbound.write(msg.encode(msg.Received(client, now, message)))
        finally:
            self._channels.inbound.write(msg.encode(msg.Gone(client)))
            sending.cancel()

    async def _serve_video(self, connection: ServerConnection) -> None:
        sending = asyncio.create_task(self._images.send(connection))
        limit = RateLimit(time.monotonic())
        try:
            async for data in connection:
                try:
                    drawn = msg.decode_video(data)
                except (msgspec.MsgspecError, UnicodeError):
                    await connection.close(POLICY_VIOLATION, "malformed message")
                    return
                if not limit.allows(time.monotonic()):
                    await connection.close(POLICY_VIOLATION, "too many messages")
                    return
                self._images.acknowledge(connection, drawn.image, drawn.width)
        finally:
            self._images.remove(connection)
            sending.cancel()
