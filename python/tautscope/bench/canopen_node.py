"""A simulated CANopen device: object dictionary, SDO server, PDOs, NMT, heartbeats (CiA 301).

It shares the table of objects with `tautscope.hardware`, but no protocol code. It has no thread and
no clock: the caller passes frames and the time.
"""

import math
import struct
from collections.abc import Callable, Collection

from tautscope.hardware.object_dictionary import Entry, device_profile

BOOT, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0x00, 0x04, 0x05, 0x7F
NMT_COMMANDS = {0x01: OPERATIONAL, 0x02: STOPPED, 0x80: PRE_OPERATIONAL}
NMT_RESETS = (0x81, 0x82)
INVALID = 1 << 31

BAD_COMMAND = 0x0504_0001
READ_ONLY = 0x0601_0002
NO_OBJECT = 0x0602_0000
NOT_MAPPABLE = 0x0604_0041
TOO_LONG_FOR_PDO = 0x0604_0042
WRONG_LENGTH = 0x0607_0010
NO_SUBINDEX = 0x0609_0011
OUT_OF_RANGE = 0x0609_0030
WRONG_STATE = 0x0800_0022

HEARTBEAT_LOST = 0x8130
"""Emergency code: life guard error or heartbeat error."""

Key = tuple[int, int]
Send = Callable[[int, bytes], None]


class CanopenNode:
    """One CANopen device.

    Args:
        node: Node id.
        send: Called with identifier and data of each frame it sends.
        absent: Indices of objects it lacks.
    """

    def __init__(self, node: int, send: Send, absent: Collection[int] = ()) -> None:
        self.node = node
        self.entries: dict[Key, Entry] = {
            (entry.index, entry.subindex): entry
            for entry in device_profile(node)
            if entry.index not in absent
        }
        self._send = send
        self.state = BOOT
        self.values: dict[Key, int] = {}
        self.next_heartbeat = math.inf
        self.heartbeat_deadline = math.inf

    def boot(self, now: float) -> None:
        """Power on, or NMT reset: set defaults, send boot-up, become pre-operational."""
        self.values = {key: entry.default for key, entry in self.entries.items()}
        self.next_heartbeat = self.heartbeat_deadline = math.inf
        self.state = PRE_OPERATIONAL
        self._send(0x700 + self.node, bytes([BOOT]))

    def deadline(self) -> float:
        """The time of the next action of `tick` [s]."""
        return min(self.next_heartbeat, self.heartbeat_deadline)

    def tick(self, now: float) -> None:
        """Send the heartbeat when due, and check the heartbeat of the master."""
        if now >= self.next_heartbeat:
            self._send(0x700 + self.node, bytes([self.state]))
            period = self.values[0x1017, 0] / 1e3
            self.next_heartbeat = max(self.next_heartbeat + period, now)
        if now >= self.heartbeat_deadline:
            self.heartbeat_deadline = math.inf
            self.emergency(HEARTBEAT_LOST, 0x11)
            self.on_connection_lost(now)

    def receive(self, identifier: int, data: bytes, now: float) -> None:
        """Handle a frame from the bus."""
        if identifier == 0x000 and len(data) == 2 and data[1] in (0, self.node):
            self._nmt(data[0], now)
        elif identifier == 0x080:
            if self.state == OPERATIONAL:
                self.on_sync(now)
        elif identifier == 0x600 + self.node and len(data) == 8 and self.state != STOPPED:
            self._send(0x580 + self.node, self._serve_sdo(data, now))
        elif identifier >= 0x700:
            consumer = self.values.get((0x1016, 1), 0)
            if consumer >> 16 & 0x7F == identifier - 0x700 and consumer & 0xFFFF:
                self.heartbeat_deadline = now + (consumer & 0xFFFF) / 1e3
        elif self.state == OPERATIONAL:
            for base in (0x1400, 0x1401):
                if self._is_valid(base) and self.values[base, 1] & 0x7FF == identifier:
                    self._unpack(base, data, now)

    def emergency(self, code: int, register: int) -> None:
        """Send an emergency object with error code and error register."""
        self.values[0x1001, 0] = register
        self.values[0x603F, 0] = code
        self._send(0x80 + self.node, struct.pack("<HB5x", code, register))

    def send_pdo(self, base: int) -> None:
        """Send a TxPDO, if it is valid."""
        if self.state != OPERATIONAL or not self._is_valid(base):
            return
        data = b"".join(
            self.entries[key].encode(self.values[key]) for key in self._mapped(base + 0x200)
        )
        self._send(self.values[base, 1] & 0x7FF, data)

    # Overridden by device profiles

    def on_write(self, key: Key, value: int, now: float) -> int | None:
        """Handle a write before the value is stored; return an abort code to refuse it."""
        return None

    def on_sync(self, now: float) -> None:
        """Handle SYNC."""

    def on_connection_lost(self, now: float) -> None:
        """Handle a missing heartbeat of the master, or the NMT transition out of operational."""

    # CiA 301

    def _nmt(self, command: int, now: float) -> None:
        if command in NMT_RESETS:
            self.on_connection_lost(now)
            self.boot(now)
        elif command in NMT_COMMANDS:
            was, self.state = self.state, NMT_COMMANDS[command]
            if was == OPERATIONAL != self.state:
                self.on_connection_lost(now)

    def _is_valid(self, base: int) -> bool:
        return not self.values[base, 1] & INVALID

    def _mapped(self, mapping: int) -> list[Key]:
        return [_key(self.values[mapping, sub]) for sub in range(1, self.values[mapping, 0] + 1)]

    def _unpack(self, base: int, data: bytes, now: float) -> None:
        start = 0
        for key in self._mapped(base + 0x200):
            entry = self.entries[key]
            piece = data[start : start + entry.size]
            start += entry.size
            if len(piece) == entry.size:
                self._store(key, entry.decode(piece), now)

    def _serve_sdo(self, request: bytes, now: float) -> bytes:
        """Answer an expedited SDO transfer; no object is longer than 4 bytes."""
        command, index, subindex = struct.unpack_from("<BHB", request)
        key = (index, subindex)
        entry = self.entries.get(key)
        if entry is None:
            known = any(index == other for other, _ in self.entries)
            return _abort(key, NO_SUBINDEX if known else NO_OBJECT)
        if command == 0x40:
            data = entry.encode(self.values[key])
            answer = 0x43 | (4 - len(data)) << 2
            return struct.pack("<BHB", answer, *key) + data.ljust(4, b"\0")
        if command & 0xE3 != 0x23:
            return _abort(key, BAD_COMMAND)
        size = 4 - (command >> 2 & 3)
        if size != entry.size:
            return _abort(key, WRONG_LENGTH)
        if entry.access != "rw":
            return _abort(key, READ_ONLY)
        code = self._store(key, entry.decode(request[4 : 4 + size]), now)
        return struct.pack("<BHB4x", 0x60, *key) if code is None else _abort(key, code)

    def _store(self, key: Key, value: int, now: float) -> int | None:
        code = self._pdo_abort_code(key, value) or self.on_write(key, value, now)
        if code is None:
            self.values[key] = value
            if key == (0x1017, 0):
                self.next_heartbeat = now if value else math.inf
            elif key == (0x1016, 1):
                self.heartbeat_deadline = math.inf  # monitoring starts with the first heartbeat
        return code

    def _pdo_abort_code(self, key: Key, value: int) -> int | None:
        """Check a change of a PDO mapping (CiA 301): the PDO must be invalid, the mapping empty."""
        index, subindex = key
        if 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00:
            if self._is_valid(index - 0x200) or (subindex and self.values[index, 0]):
                return WRONG_STATE
            if not subindex:
                keys = [_key(self.values.get((index, sub), 0)) for sub in range(1, value + 1)]
                if any(mapped not in self.entries for mapped in keys):
                    return NO_OBJECT
                if sum(self.entries[mapped].size for mapped in keys) > 8:
                    return TOO_LONG_FOR_PDO
            else:
                mapped = self.entries.get(_key(value))
                if mapped is None or not mapped.mappable or mapped.mapping != value:
                    return NOT_MAPPABLE
        return None


def _key(mapping: int) -> Key:
    """Index and sub-index in an entry of a PDO mapping."""
    return mapping >> 16, mapping >> 8 & 0xFF


def _abort(key: Key, code: int) -> bytes:
    return struct.pack("<BHBI", 0x80, *key, code)
