"""Packets of servos as a servo reads and writes them: Dynamixel protocol 2.0, and Feetech's.

Sources: ROBOTIS, DYNAMIXEL Protocol 2.0; Feetech, communication protocol of the SCS series.
"""

from typing import NamedTuple

PING, READ, WRITE, REG_WRITE, ACTION = 1, 2, 3, 4, 5
REBOOT, SYNC_READ, SYNC_WRITE = 0x08, 0x82, 0x83
STATUS = 0x55
BROADCAST = 0xFE
_LONGEST = 1024
"""Longest packet of protocol 2.0 [byte]."""
_V2_HEADER = b"\xff\xff\xfd\x00"


class Packet(NamedTuple):
    """An instruction to a servo.

    Attributes:
        servo: Id, or `BROADCAST`.
        is_intact: Whether the checksum is right.
        size: Length on the line [byte].
    """

    servo: int
    instruction: int
    data: bytes
    is_intact: bool
    size: int


class DynamixelPackets:
    """Protocol 2.0: CRC-16, byte stuffing, words of two bytes for address and length."""

    def split(self, buffer: bytearray) -> list[Packet]:
        """Take the complete packets from the front of a buffer."""
        found = []
        while (start := buffer.find(_V2_HEADER)) >= 0 and len(buffer) >= start + 7:
            servo = buffer[start + 4]
            size = 7 + int.from_bytes(buffer[start + 5 : start + 7], "little")
            if not 10 <= size <= _LONGEST:
                del buffer[: start + 4]  # no packet
                continue
            if len(buffer) < start + size:
                break
            raw = bytes(buffer[start : start + size])
            del buffer[: start + size]
            is_intact = crc16(raw[:-2]) == int.from_bytes(raw[-2:], "little")
            body = raw[7:-2].replace(b"\xff\xff\xfd\xfd", b"\xff\xff\xfd")
            found.append(Packet(servo, body[0], body[1:], is_intact, size))
        return found

    def status(self, servo: int, error: int, data: bytes = b"") -> bytes:
        """The answer of a servo."""
        body = bytes([STATUS, error]) + data
        body = body.replace(b"\xff\xff\xfd", b"\xff\xff\xfd\xfd")
        head = _V2_HEADER + bytes([servo]) + (len(body) + 2).to_bytes(2, "little")
        return head + body + crc16(head + body).to_bytes(2, "little")


class FeetechPackets:
    """Feetech's protocol, as Dynamixel 1.0: a sum as checksum, bytes for address and length."""

    def split(self, buffer: bytearray) -> list[Packet]:
        """Take the complete packets from the front of a buffer."""
        found = []
        while (start := buffer.find(b"\xff\xff")) >= 0 and len(buffer) >= start + 4:
            size = 4 + buffer[start + 3]
            if buffer[start + 2] == 0xFF or size < 6:
                del buffer[: start + 1]
                continue
            if len(buffer) < start + size:
                break
            raw = bytes(buffer[start : start + size])
            del buffer[: start + size]
            is_intact = raw[-1] == ~sum(raw[2:-1]) & 0xFF
            found.append(Packet(raw[2], raw[4], raw[5:-1], is_intact, size))
        return found

    def status(self, servo: int, error: int, data: bytes = b"") -> bytes:
        """The answer of a servo."""
        body = bytes([servo, len(data) + 2, error]) + data
        return b"\xff\xff" + body + bytes([~sum(body) & 0xFF])


def crc16(data: bytes) -> int:
    """CRC-16/BUYPASS: polynomial 0x8005, from 0, not reflected."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x8005 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc
