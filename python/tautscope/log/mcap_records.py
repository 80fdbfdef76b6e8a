"""Records and messages of an MCAP file that may be truncated or damaged."""

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

_MAX_CHUNK_SIZE = 2**30
"""Largest accepted size of an uncompressed chunk [bytes]; a damaged one could fill the memory."""
_MESSAGE_OPCODES = (Opcode.CHUNK, Opcode.SCHEMA, Opcode.CHANNEL)
"""A message of a log is in a chunk, which has a checksum: one outside is a damaged record."""


@dataclass(slots=True)
class Damage:
    """The parts of a file that could not be read.

    Attributes:
        is_truncated: Whether the end mark is missing.
        lost_bytes: Bytes after the last complete record.
        bad_chunks: Number of chunks with a wrong checksum or content; they are skipped.
    """

    is_truncated: bool = True
    lost_bytes: int = 0
    bad_chunks: int = 0

    def __bool__(self) -> bool:
        """Whether there is any damage."""
        return self.is_truncated or self.bad_chunks > 0

    def __str__(self) -> str:
        """What is missing, in words; empty without damage."""
        lost = f"its last {self.lost_bytes} bytes are incomplete"
        parts = {
            lost if self.lost_bytes else "it has no end": self.is_truncated,
            f"{self.bad_chunks} damaged chunks were skipped": self.bad_chunks,
        }
        return "; ".join(text for text, is_so in parts.items() if is_so)


def unpack(opcode: int, payload: bytes) -> list[McapRecord]:
    """The schemas, channels and messages of a record; damaged bytes raise any exception."""
    stream = ReadDataStream(BytesIO(payload))
    if opcode == Opcode.CHUNK:
        chunk = Chunk.read(stream)
        sizes = [chunk.uncompressed_size]
        if chunk.compression == "zstd":
            sizes.append(zstandard.frame_content_size(chunk.data))
        if max(sizes) > _MAX_CHUNK_SIZE:
            raise ValueError(f"chunk of {max(sizes)} bytes")
        return breakup_chunk(chunk, validate_crc=True)
    if opcode == Opcode.SCHEMA:
        return [Schema.read(stream)]
    return [Channel.read(stream)]


def read_records(file: IO[bytes], damage: Damage) -> Iterator[tuple[int, int, bytes]]:
    """Byte offset, opcode and content of the complete records that can contain messages.

    Args:
        file: Seekable, positioned at the beginning of a record; read from there on.
        damage: Receives the damage at the end of the file.
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
        if head[0] in _MESSAGE_OPCODES:
            yield offset, head[0], file.read(length)
        offset += 9 + length
        if head[0] == Opcode.FOOTER:
            file.seek(offset)
            damage.is_truncated = file.read() != MCAP0_MAGIC
            damage.lost_bytes = size - offset if damage.is_truncated else 0
            return


def no_log(path: Path) -> MissingPathError:
    """The error of a path that is no file; of a folder it names a log in it."""
    found = min(map(str, path.glob("*.mcap")), default=None)
    return MissingPathError(
        "log", str(path), "an MCAP file" + (f", such as {found}" if found else "")
    )


def read_messages(path: Path, damage: Damage) -> Iterator[tuple[int, str, Message]]:
    """The undamaged messages of an MCAP file with offset of the record, and topic; in its order.

    Raises:
        MissingPathError: There is no such file.
        RecordError: The file is not MCAP.
    """
    topic_names: dict[int, str] = {}
    try:
        file = path.open("rb")
    except (FileNotFoundError, IsADirectoryError):
        raise no_log(path) from None
    with file:
        if file.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise RecordError("log", str(path), "an MCAP file")
        for offset, opcode, payload in read_records(file, damage):
            try:
                records = unpack(opcode, payload)
            except Exception:  # damaged bytes make the library raise exceptions of any kind
                damage.bad_chunks += 1
                continue
            for record in records:
                if isinstance(record, Channel):
                    topic_names[record.id] = record.topic
                elif isinstance(record, Message) and record.channel_id in topic_names:
                    yield offset, topic_names[record.channel_id], record
