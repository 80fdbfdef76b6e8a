"""Writer of an MCAP file with the topics of a log.

The records are those of the `mcap` library. Its own writer compresses with zstd level 3, which for
images takes six times as long as level 1 and gives larger files (decision 0020).
"""

import zlib
from collections import Counter
from collections.abc import Sequence
from typing import IO

import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from tautscope._core import __version__
from tautscope.log import topics
from tautscope.log.cdr import schema

CHUNK_SIZE = 1 << 20
"""Size at which a chunk is closed [bytes]; one image of the article's size is larger."""
_LEVEL = 1


class McapFile:
    """Writes messages in chunks; a closed chunk goes to the operating system at once.

    Args:
        file: An empty file, open for writing.

    Attributes:
        counts: Topic -> number of messages.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self._file, self._at = file, 0
        self.counts: Counter[str] = Counter()
        self._compressor = zstandard.ZstdCompressor(level=_LEVEL)
        self._schemas = {
            kind: records.Schema(id=number, name=kind, encoding="ros2msg", data=schema(kind))
            for number, kind in enumerate(sorted(set(topics.TYPES.values())), 1)
        }
        self._channels = {
            topic: records.Channel(
                id=number,
                topic=topic,
                message_encoding="cdr",
                metadata={"offered_qos_profiles": ""},
                schema_id=self._schemas[kind].id,
            )
            for number, (topic, kind) in enumerate(topics.TYPES.items(), 1)
        }
        self._chunks: list[records.ChunkIndex] = []
        self._body, self._indices = RecordBuilder(), dict[int, records.MessageIndex]()
        self._put(MCAP0_MAGIC + _bytes(records.Header("ros2", f"tautscope {__version__}")))
        for record in (*self._schemas.values(), *self._channels.values()):
            record.write(self._body)

    def add(self, topic: str, data: bytes, sequence: int, at: int, sent: int | None = None) -> None:
        """Add a message.

        Args:
            topic: A topic of `tautscope.log.topics`.
            data: The message as CDR.
            sequence: Position in the loop's order.
            at: Log time [ns since 1970].
            sent: Publish time [ns since 1970]; by default the log time.
        """
        channel = self._channels[topic].id
        index = self._indices.setdefault(channel, records.MessageIndex(channel, []))
        index.records.append((at, self._body.count))
        message = records.Message(
            channel_id=channel,
            log_time=at,
            data=data,
            publish_time=at if sent is None else sent,
            sequence=sequence,
        )
        message.write(self._body)
        self.counts[topic] += 1
        if self._body.count > CHUNK_SIZE:
            self.flush()

    def flush(self) -> None:
        """Close and write the current chunk, if it has messages."""
        if not self._indices:
            return
        data = _ended(self._body)
        times = [at for index in self._indices.values() for at, _ in index.records]
        chunk = records.Chunk(
            compression="zstd",
            data=self._compressor.compress(data),
            message_start_time=min(times),
            message_end_time=max(times),
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        start = self._at
        self._put(_bytes(chunk))
        length, offsets, indices = self._at - start, dict[int, int](), RecordBuilder()
        for channel, index in self._indices.items():
            offsets[channel] = self._at + indices.count
            index.write(indices)
        entry = records.ChunkIndex(
            chunk_length=length,
            chunk_start_offset=start,
            compression="zstd",
            compressed_size=len(chunk.data),
            message_end_time=chunk.message_end_time,
            message_index_length=indices.count,
            message_index_offsets=offsets,
            message_start_time=chunk.message_start_time,
            uncompressed_size=chunk.uncompressed_size,
        )
        self._put(_ended(indices))
        self._chunks.append(entry)
        self._indices = {}

    def finish(self) -> None:
        """Write the last chunk and the summary section."""
        self.flush()
        self._put(_bytes(records.DataEnd(0)))
        start, summary, offsets = self._at, RecordBuilder(), RecordBuilder()
        counts = {self._channels[topic].id: count for topic, count in self.counts.items()}
        statistics = records.Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=counts,
            chunk_count=len(self._chunks),
            message_count=self.counts.total(),
            metadata_count=0,
            message_start_time=min((each.message_start_time for each in self._chunks), default=0),
            message_end_time=max((each.message_end_time for each in self._chunks), default=0),
            schema_count=len(self._schemas),
        )
        groups: list[tuple[Opcode, Sequence[records.McapRecord]]] = [
            (Opcode.SCHEMA, [*self._schemas.values()]),
            (Opcode.CHANNEL, [*self._channels.values()]),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunks),
        ]
        for opcode, group in groups:
            begin = summary.count
            for record in group:
                record.write(summary)
            if group:
                records.SummaryOffset(opcode, start + begin, summary.count - begin).write(offsets)
        offset_start = start + summary.count
        body = _ended(summary) + _ended(offsets)
        footer = records.Footer(start, offset_start, summary_crc=0)
        # The checksum covers the summary and the footer except the checksum itself.
        footer.summary_crc = zlib.crc32(body + _bytes(footer)[:-4])
        self._put(body + _bytes(footer) + MCAP0_MAGIC)

    def _put(self, data: bytes) -> None:
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]
        self._at += len(data)


def _bytes(record: records.McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return _ended(builder)


def _ended(builder: RecordBuilder) -> bytes:
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data
