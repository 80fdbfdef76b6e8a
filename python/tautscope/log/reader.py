"""A log read back, whole or torn: what comes after the tear is lost, what comes before is not."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from os import PathLike
from pathlib import Path
from typing import IO

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Schema
from mcap.stream_reader import breakup_chunk
from mcap.writer import MCAP0_MAGIC
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.errors import MissingPathError, RecordError
from tautscope.log import messages as msg
from tautscope.log.cdr import decode
from tautscope.log.images import ImageCodec
from tautscope.loop.references import Segment
from tautscope.loop.rig import Sample
from tautscope.runs.recording import Recording
from tautscope.runs.run_recorder import Row, RunRecorder

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
class Tick:
    """One control tick as recorded; its sample is without the frame."""

    sample: Sample
    reference: msg.Floats
    command: msg.Floats
    made_at: float | None
    raw: msg.Messages


@dataclass(frozen=True, slots=True)
class Update:
    """One image update as recorded: its `frame_row`, and the offsets after it."""

    row: Row
    delta_minus: msg.Floats
    delta_plus: msg.Floats
    raw: msg.Messages


@dataclass(frozen=True, slots=True)
class Told:
    """Something the operator or the rig told the loop, as `HysteresisReduction.on_event`."""

    what: str
    raw: msg.Messages


@dataclass(frozen=True, eq=False)
class Log:
    """A log in memory; images stay in the file until they are asked for.

    Attributes:
        path: The file.
        config: As used by the loop.
        compensated: As given to the loop.
        segments: Which DOF moved when.
        versions: Of the programs that wrote it.
        events: Index -> tick, update or what else it was told, in the loop's order. Indices count
            from 1; one that is missing was dropped when the log was written, or is lost.
        warnings: What was to be told a person.
        damage: What could not be read.
    """

    path: Path
    config: Config
    compensated: bool
    segments: tuple[Segment, ...]
    versions: dict[str, str]
    events: dict[int, Tick | Update | Told]
    warnings: tuple[str, ...]
    damage: Damage
    _images: dict[int, tuple[int, int]] = field(repr=False)
    """Index -> where its chunk is in the file, and the images' channel."""

    @property
    def missing(self) -> int:
        """How many of them are not there though later ones are."""
        return max(self.events, default=0) - len(self.events)

    def has_image(self, index: int) -> bool:
        """Whether the image of an update is in the log."""
        return index in self._images

    def image(self, index: int) -> NDArray[np.uint8]:
        """The image of an update, as the loop saw it if `recording.image_format` is lossless.

        Raises:
            RecordError: It is not in the log, or is no picture of the configured camera.
        """
        if index not in self._images:
            raise RecordError(f"{self.path}: image", index, "an update with its image in the log")
        at, channel = self._images[index]
        with self.path.open("rb") as file:
            file.seek(at)
            record = next(raw_records(file, Damage()))
        data = next(
            message.data
            for message in record.unpacked()
            if isinstance(message, Message)
            and (message.channel_id, message.sequence) == (channel, index)
        )
        codec = ImageCodec(self.config.camera, self.config.recording)
        return codec.decode(decode(msg.TOPICS[msg.IMAGE], data)["data"])

    def recording(self) -> Recording:
        """Trace and frames, as `run_experiment` returned them; the snapshot is None."""
        recorder = RunRecorder(self.config)
        for event in self.events.values():
            if isinstance(event, Tick):
                recorder.add_tick(event.sample, event.reference, event.command)
            elif isinstance(event, Update):
                recorder.add_frame(event.row, event.delta_minus, event.delta_plus)
        return Recording(*recorder.tables(), self.config, self.compensated, self.segments)


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


def read_log(path: str | PathLike[str]) -> Log:
    """Read a log, whole or torn; see `Log.damage`.

    Raises:
        MissingPathError: There is no such file.
        RecordError: It is not MCAP, or not of tautscope.
        ConfigError: It was written with a configuration this version does not know.
    """
    file = Path(path)
    damage = Damage()
    groups: defaultdict[int, msg.Messages] = defaultdict(dict)
    images: dict[int, tuple[int, int]] = {}
    warnings: list[str] = []
    for raw, topic, record in messages_in(file, damage):
        if topic == msg.IMAGE:
            images[record.sequence] = raw.offset, record.channel_id
        elif topic == msg.WARNING:
            warnings.append(decode(msg.TOPICS[topic], record.data)["msg"])
        elif topic in msg.TOPICS:
            groups[record.sequence][topic] = record.data
    facts, versions = msg.read_head(groups.pop(0, {}))
    events: dict[int, Tick | Update | Told] = {}
    for index, messages in sorted(groups.items()):
        if messages.keys() >= msg.OF_TICK:
            events[index] = Tick(*msg.read_tick(messages), messages)
        elif messages.keys() >= msg.OF_UPDATE:
            events[index] = Update(*msg.read_update(messages), messages)
        elif msg.EVENT in messages:
            what = decode(msg.TOPICS[msg.EVENT], messages[msg.EVENT])["data"]
            events[index] = Told(what, messages)
    return Log(
        file,
        facts.config,
        facts.compensated,
        facts.segments,
        versions,
        events,
        tuple(warnings),
        damage,
        {index: place for index, place in images.items() if index in events},
    )
