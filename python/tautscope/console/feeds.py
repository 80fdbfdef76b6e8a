"""States and images to the pages: the newest only, to each page as fast as it takes them."""

import asyncio
import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from tautscope.calibration.images import to_bgr
from tautscope.config import PixelFormat
from tautscope.console import messages as msg
from tautscope.console.shared import Channels, ImageChannel

POLL_PERIOD = 0.004
"""Time between two looks into the shared memory [s]."""
IN_FLIGHT = 2
"""Images that a page has been sent and has not drawn yet, at most."""
JPEG_QUALITY = 80


class StateFeed:
    """The state of the control process, and its replies to each page.

    Args:
        layout: Sent to each page once.
        latency: Returns median and 95th percentile of the time from an image's arrival until it
            was drawn [s], if they are known.

    Attributes:
        holder: The connection that holds the lease, as of the newest state.
    """

    def __init__(
        self, channels: Channels, layout: object, latency: Callable[[], tuple[float, float] | None]
    ) -> None:
        self._channels, self._layout, self._latency = channels, layout, latency
        self._newest = b""
        self._number = 0
        self.holder: int | None = None
        self._has_news = asyncio.Condition()
        self._replies: dict[int, deque[bytes]] = {}

    async def run(self) -> None:
        """Poll the shared memory."""
        while True:
            await asyncio.sleep(POLL_PERIOD)
            found, reply = self._channels.state.newest(), self._channels.replies.following()
            if found is None and reply is None:
                continue
            if found is not None:
                self._number, self._newest = found
                self.holder = msg.decode_state(self._newest)["holder"]
            while reply is not None:
                if (queue := self._replies.get(msg.decode_reply(reply[1]).client)) is not None:
                    queue.append(reply[1])
                reply = self._channels.replies.following()
            async with self._has_news:
                self._has_news.notify_all()

    async def send(self, connection: ServerConnection, client: int) -> None:
        """Send the newest state to a page whenever it has taken the last one."""
        replies = self._replies[client] = deque(maxlen=32)
        number = 0
        try:
            welcome = {"type": "welcome", "client": client, "layout": self._layout}
            await connection.send(msg.encode(welcome).decode())
            while True:
                async with self._has_news:
                    await self._has_news.wait_for(
                        lambda: self._number != number or bool(replies)  # noqa: B023
                    )
                while replies:
                    reply = replies.popleft().decode()
                    await connection.send(f'{{"type":"reply","reply":{reply}}}')
                if self._number != number:
                    number = self._number
                    latency = msg.encode(self._latency()).decode()
                    text = self._newest.decode()
                    await connection.send(f'{{"type":"state","latency":{latency},"state":{text}}}')
        except ConnectionClosed:
            pass
        finally:
            del self._replies[client]


@dataclass
class _Viewer:
    """A page that gets images.

    Attributes:
        sent: Sequences of images sent and not drawn yet, with the times of their arrival; None of
            the first, which may be an old one.
        may_send: Set when one may be sent.
        width: At which it shows images [px]; infinite until it is known.
    """

    sent: dict[int, float | None] = field(default_factory=dict)
    may_send: asyncio.Event = field(default_factory=asyncio.Event)
    width: float = math.inf


class ImageFeed:
    """The newest image as JPEG to each page; a page that is slow misses images.

    A message is the length of the overlay in 4 bytes, little-endian, the overlay in JSON, and the
    JPEG, which is smaller than the camera's image if no page shows it in full size.

    Attributes:
        latencies: Times from the arrival of an image in the control process until a page reported
            that it was drawn [s], the newest 250 of all pages.
    """

    def __init__(self, channel: ImageChannel, pixel_format: PixelFormat) -> None:
        self._channel, self._pixel_format = channel, pixel_format
        self._viewers: dict[ServerConnection, _Viewer] = {}
        self._newest = b""
        self._sequence = 0
        self._arrived_at = 0.0
        self.latencies: deque[float] = deque(maxlen=250)

    async def run(self) -> None:
        """Poll the shared memory; encode an image if somebody sees it."""
        while True:
            await asyncio.sleep(POLL_PERIOD)
            if not self._viewers or (found := self._channel.newest()) is None:
                continue
            image, overlay = found
            width = max(viewer.width for viewer in self._viewers.values())
            jpeg = await asyncio.to_thread(encode_jpeg, image, self._pixel_format, width)
            info = msg.encode(overlay)
            self._newest = b"".join((len(info).to_bytes(4, "little"), info, jpeg))
            self._sequence, self._arrived_at = overlay.sequence, overlay.published_at
            for viewer in self._viewers.values():
                viewer.may_send.set()

    async def send(self, connection: ServerConnection) -> None:
        """Send the newest image to a page whenever it has drawn an earlier one."""
        viewer = self._viewers[connection] = _Viewer()
        viewer.may_send.set()  # while a rig is off, or a recording pauses, no other image comes
        sequence = 0
        try:
            while True:
                await viewer.may_send.wait()
                viewer.may_send.clear()
                if self._sequence == sequence or len(viewer.sent) >= IN_FLIGHT:
                    continue
                viewer.sent[self._sequence] = self._arrived_at if sequence else None
                sequence = self._sequence
                await connection.send(self._newest)
        except ConnectionClosed:
            pass
        finally:
            del self._viewers[connection]

    @property
    def latency(self) -> tuple[float, float] | None:
        """Median and 95th percentile of the latencies [s]; None if nothing was drawn."""
        found = sorted(self.latencies)
        return (found[len(found) // 2], found[19 * len(found) // 20]) if found else None

    def acknowledge(self, connection: ServerConnection, sequence: int, width: int) -> None:
        """A page has drawn an image, and with it those sent before, `width` pixels wide."""
        if (viewer := self._viewers.get(connection)) is None:
            return
        viewer.width = width or math.inf
        if (arrived_at := viewer.sent.get(sequence)) is not None:
            self.latencies.append(time.monotonic() - arrived_at)
        viewer.sent = {each: at for each, at in viewer.sent.items() if each > sequence}
        viewer.may_send.set()


def encode_jpeg(image: NDArray[np.uint8], pixel_format: PixelFormat, width: float) -> bytes:
    """An image as JPEG, for the page; halved while that leaves at least `width` pixels across."""
    pixels: NDArray[Any] = to_bgr(image, pixel_format)
    while pixels.shape[1] // 2 >= max(width, 1):
        size = pixels.shape[1] // 2, pixels.shape[0] // 2
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    options = (cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY)
    return cv2.imencode(".jpg", pixels, options)[1].tobytes()
