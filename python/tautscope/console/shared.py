"""The memory that control process and web server share, and what crosses it, without locks.

Of each ring of records one process writes, one reads; neither waits for the other. A record that
the writer overwrites while it is read fails its checksum and is not used.
"""

import ctypes
import math
import struct
import zlib
from multiprocessing.context import SpawnContext
from typing import Any

import msgspec
import numpy as np

from tautscope.calibration.images import Image
from tautscope.config import Config
from tautscope.console.messages import LARGEST_MESSAGE, encode
from tautscope.console.state import layout_of
from tautscope.loop.frame_layout import FrameLayout

_HEADER = struct.Struct("<QII")
"""Number of the record from 1 on, length and checksum of its data."""
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


class Slots:
    """Numbered records in a ring of equal slots.

    Args:
        memory: Memory that both processes share, zero at the start.
        count: Number of slots; the reader may be so many records behind.
    """

    def __init__(self, memory: memoryview, count: int) -> None:
        self._memory = memory.cast("B")
        self._count = count
        self._stride = len(self._memory) // count
        self._written = self._read = 0

    @staticmethod
    def size(capacity: int, count: int) -> int:
        """Bytes of memory for `count` records of up to `capacity` bytes."""
        return count * (_HEADER.size + capacity)

    @property
    def capacity(self) -> int:
        """Largest length of a record [byte]."""
        return self._stride - _HEADER.size

    def write(self, data: bytes) -> int:
        """Write a record; its number.

        Raises:
            ValueError: It is longer than `capacity`.
        """
        if len(data) > self.capacity:
            raise ValueError(f"a record of {len(data)} bytes, longer than {self.capacity}")
        number = self._written + 1
        at = number % self._count * self._stride
        start = at + _HEADER.size
        self._memory[start : start + len(data)] = data
        checksum = zlib.crc32(data, number & 0xFFFF_FFFF)
        _HEADER.pack_into(self._memory, at, number, len(data), checksum)
        self._written = number
        return number

    def newest(self) -> tuple[int, bytes] | None:
        """Number and data of the newest complete record, if it was not read before."""
        number = max(
            _HEADER.unpack_from(self._memory, slot * self._stride)[0] for slot in range(self._count)
        )
        if number <= self._read or (data := self._record(number)) is None:
            return None
        self._read = number
        return number, data

    def following(self) -> tuple[int, bytes] | None:
        """Number and data of the record after the last one read; a gap are overwritten records."""
        data = self._record(self._read + 1)
        if data is not None:
            self._read += 1
            return self._read, data
        at = (self._read + 1) % self._count * self._stride
        if _HEADER.unpack_from(self._memory, at)[0] > self._read + 1:
            return self.newest()
        return None

    def _record(self, number: int) -> bytes | None:
        at = number % self._count * self._stride
        found, length, checksum = _HEADER.unpack_from(self._memory, at)
        if found != number or length > self.capacity:
            return None
        data = bytes(self._memory[at + _HEADER.size : at + _HEADER.size + length])
        return data if zlib.crc32(data, number & 0xFFFF_FFFF) == checksum else None


class Overlay(msgspec.Struct):
    """What is drawn over an image; coordinates in its pixels.

    Attributes:
        sequence: Of the image, as in `ImageTimes`.
        published_at: [s, monotonic clock].
        width, height: Of the image [px].
        measured, predicted, uncompensated: Outlines of the bands, each (n, 2): those found, as the
            model predicts them, and where they would be without compensation.
        tip, target, uncompensated_tip: Centre of the distal band where the tip is estimated, where
            the reference is, and without compensation; None if not known.
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
        slots = (Slots(memoryview(memory.slots[name]), n) for name, (_, n) in _SIZES.items())
        self.servo, self.stop, self.inbound, self.state, self.replies, images = slots
        self.images = ImageChannel(memory, images)


class ImageChannel:
    """The newest images and what is drawn over them."""

    def __init__(self, memory: SharedMemory, info: Slots) -> None:
        self._pixels = np.frombuffer(memory.pixels, np.uint8).reshape(_IMAGES, *memory.shape)
        self._info = info
        self._number = 0
        self._decode = msgspec.json.Decoder(Overlay).decode

    def write(self, image: Image, overlay: Overlay) -> None:
        """Write an image."""
        np.copyto(self._pixels[(self._number + 1) % _IMAGES], image)
        self._number = self._info.write(encode(overlay))

    def newest(self) -> tuple[Image, Overlay] | None:
        """A copy of the newest image, if it was not read before.

        An image that is overwritten meanwhile shows parts of both, which harms only the view.
        """
        if (found := self._info.newest()) is None:
            return None
        number, data = found
        return self._pixels[number % _IMAGES].copy(), self._decode(data)
