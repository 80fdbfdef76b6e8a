"""Messages between two processes in shared memory, without locks.

One process writes, one reads; neither waits for the other. A record that the writer overwrites
while it is read fails its checksum and is not used.
"""

from __future__ import annotations

import struct
import zlib

_HEADER = struct.Struct("<QII")
"""Number of the record from 1 on, length and checksum of its data."""
_NUMBER = struct.Struct("<Q")


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
            _NUMBER.unpack_from(self._memory, slot * self._stride)[0] for slot in range(self._count)
        )
        if number <= self._read:
            return None
        data = self._record(number)
        if data is None:
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
        if _NUMBER.unpack_from(self._memory, at)[0] > self._read + 1:
            return self.newest()
        return None

    def _record(self, number: int) -> bytes | None:
        at = number % self._count * self._stride
        found, length, checksum = _HEADER.unpack_from(self._memory, at)
        if found != number or length > self.capacity:
            return None
        data = bytes(self._memory[at + _HEADER.size : at + _HEADER.size + length])
        return data if zlib.crc32(data, number & 0xFFFF_FFFF) == checksum else None
