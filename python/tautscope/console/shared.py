"""The memory that control process and web server share, and what crosses it."""

from __future__ import annotations

import ctypes
import math
from multiprocessing.context import SpawnContext
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.console.access import LARGEST_MESSAGE
from tautscope.console.slots import Slots
from tautscope.console.state import layout_of
from tautscope.loop.frame_layout import FrameLayout

Image = NDArray[np.uint8]
_SMALL = 2 * LARGEST_MESSAGE
_IMAGES = 3
_SIZES = {
    "servo": (_SMALL, 256),
    "stop": (_SMALL, 2),
    "inbound": (_SMALL, 256),
    "state": (1 << 15, 2),
    "replies": (_SMALL, 256),
    "images": (1 << 14, _IMAGES),
}
"""Channel -> largest record [byte] and number of records. The web server writes the first three."""


class Overlay(msgspec.Struct):
    """What is drawn over an image; coordinates in its pixels.

    Attributes:
        sequence: Of the image, as in `ImageTimes`.
        published_at: [s, monotonic clock].
        width: Of the image [px].
        height: Of the image [px].
        measured: Outlines of the bands found, each (n, 2).
        predicted: Outlines of the bands that the model predicted.
        tip: Centre of the distal band where the tip is estimated; None if not known.
        target: The same where the reference is.
        uncompensated: Outlines of the bands where they would be without compensation.
        uncompensated_tip: The centre of the distal one.
    """

    sequence: int
    published_at: float
    width: int
    height: int
    measured: list[list[tuple[float, float]]] = []
    predicted: list[list[tuple[float, float]]] = []
    tip: tuple[float, float] | None = None
    target: tuple[float, float] | None = None
    uncompensated: list[list[tuple[float, float]]] = []
    uncompensated_tip: tuple[float, float] | None = None


class SharedMemory:
    """Memory for the messages in both directions; pass it to the other process at its start."""

    def __init__(self, context: SpawnContext, config: Config) -> None:
        def memory(size: int) -> Any:
            return context.RawArray(ctypes.c_uint8, size)

        self.layout = layout_of(config)
        self.shape = FrameLayout(config.camera).shape
        self.pixel_format = config.camera.pixel_format
        self.slots = {name: memory(Slots.size(*size)) for name, size in _SIZES.items()}
        self.pixels = memory(_IMAGES * math.prod(self.shape))
        self.ready = memory(8)


class Channels:
    """Views of a `SharedMemory`; each process makes its own."""

    def __init__(self, memory: SharedMemory) -> None:
        slots = {
            name: Slots(memoryview(memory.slots[name]), count)
            for name, (_, count) in _SIZES.items()
        }
        self.servo, self.stop, self.inbound = slots["servo"], slots["stop"], slots["inbound"]
        self.state, self.replies = slots["state"], slots["replies"]
        self.images = ImageChannel(memory, slots["images"])


class ImageChannel:
    """The newest images and what is drawn over them."""

    def __init__(self, memory: SharedMemory, info: Slots) -> None:
        self._pixels = np.frombuffer(memory.pixels, np.uint8).reshape(_IMAGES, *memory.shape)
        self._info = info
        self._number = 0
        self._decode = msgspec.json.Decoder(Overlay).decode
        self._encode = msgspec.json.Encoder().encode

    def write(self, image: Image, overlay: Overlay) -> None:
        """Write an image."""
        np.copyto(self._pixels[(self._number + 1) % _IMAGES], image)
        self._number = self._info.write(self._encode(overlay))

    def newest(self) -> tuple[Image, Overlay] | None:
        """A copy of the newest image, if it was not read before.

        An image that is overwritten meanwhile shows parts of both, which harms only the view.
        """
        found = self._info.newest()
        if found is None:
            return None
        number, data = found
        return self._pixels[number % _IMAGES].copy(), self._decode(data)
