"""Records and messages of an MCAP file that may be truncated or damaged."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import IO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC

from tautscope.errors import MissingPathError, RecordError

_LARGEST_CHUNK = 2**30
"""What a chunk may say it unpacks to [bytes]; ours are a few MB, and a hostile one would fill the
memory."""
_WITH_MESSAGES = (Opcode.CHUNK, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)


@dataclass(slots=True)
class Damage:
    """What of a file could not be read.

    Attributes:
        is_torn: It ends before its end mark.
        lost_bytes: After the last whole record.
        bad_chunks: Chunks whose checksum or content is wrong, left out.
    """

    is_torn: bool = True
    lost_bytes: int = 0
    bad_chunks: int = 0

    def __bool__(self) -> bool:
        """Whether there is any."""
        return self.is_torn or self.bad_chunks > 0


@dataclass(frozen=True, slots=True)
class RawRecord:
    """A record of the file: where it begins, what it is, and its bytes."""

    offset: int
    opcode: int
    payload: bytes

    def unpacked(self) -> list[McapRecord]:
        """The schemas, channels and messages it is or holds; whatever is wrong with it raises."""
        stream = ReadDataStream(BytesIO(self.payload))
        if self.opcode == Opcode.CHUNK:
            chunk = Chunk.read(stream)
            sizes = [chunk.uncompressed_size]
            if chunk.compression == "zstd":
                sizes.append(zstandard.frame_content_size(chunk.data))
            if max(sizes) > _LARGEST_CHUNK:
                raise ValueError(f"a chunk that unpacks to {max(sizes)} bytes")
            return breakup_chunk(chunk, validate_crc=True)
        if self.opcode == Opcode.SCHEMA:
            return [Schema.read(stream)]
        if self.opcode == Opcode.CHANNEL:
            return [Channel.read(stream)]
        return [Message.read(stream, len(self.payload))]


def raw_records(file: IO[bytes], damage: Damage) -> Iterator[RawRecord]:
    """Every whole record from the file's position on that can hold messages.

    Args:
        file: Seekable, behind the magic or at the beginning of a record.
        damage: Told how the file ends.
    """
    offset = file.tell()
    size = file.seek(0, 2)
    while True:
        file.seek(offset)
        head = file.read(9)
        length = int.from_bytes(head[1:9], "little")
        damage.lost_bytes = size - offset
        if len(head) < 9 or offset + 9 + length > size:
            return
        if head[0] in _WITH_MESSAGES:
            yield RawRecord(offset, head[0], file.read(length))
        offset += 9 + length
        if head[0] == Opcode.FOOTER:
            file.seek(offset)
            damage.is_torn = file.read() != MCAP0_MAGIC
            damage.lost_bytes = size - offset if damage.is_torn else 0
            return


def messages_in(path: Path, damage: Damage) -> Iterator[tuple[RawRecord, str, Message]]:
    """Every message of an MCAP file that can be read, with its topic, in the order of the file.

    Raises:
        MissingPathError: There is no such file.
        RecordError: It is not MCAP.
    """
    topics: dict[int, str] = {}
    try:
        file = path.open("rb")
    except (FileNotFoundError, IsADirectoryError):
        raise MissingPathError("log", str(path), "an MCAP file") from None
    with file:
        if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise RecordError("log", str(path), "an MCAP file")
        for raw in raw_records(file, damage):
            try:
                records = raw.unpacked()
            except Exception:  # whatever the library makes of damaged bytes
                damage.bad_chunks += 1
                continue
            for record in records:
                if isinstance(record, Channel):
                    topics[record.id] = record.topic
                elif isinstance(record, Message) and record.channel_id in topics:
                    yield raw, topics[record.channel_id], record
