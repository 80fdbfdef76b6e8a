"""Reading a log, complete or truncated."""

import itertools
from collections import defaultdict
from dataclasses import dataclass, field
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Message
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.errors import RecordError
from tautscope.log import messages as msg
from tautscope.log import topics
from tautscope.log.header import read_header
from tautscope.log.images import ImageCodec
from tautscope.log.mcap_records import Damage, read_messages, read_records, unpack
from tautscope.loop.measurement import Measurement
from tautscope.loop.references import Segment
from tautscope.loop.rig import Sample
from tautscope.runs.recording import Floats, Recording
from tautscope.runs.run_recorder import Row, RunRecorder


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """A recorded control tick; the sample has no frame."""

    sample: Sample
    reference: Floats
    command: Floats
    made_at: float | None
    raw: msg.Messages


@dataclass(frozen=True, slots=True, eq=False)
class Update:
    """A recorded update: its `update_row`, the offsets after it, and its measurement if any."""

    row: Row
    delta_minus: Floats
    delta_plus: Floats
    measurement: Measurement | None
    raw: msg.Messages

    @property
    def status(self) -> tuple[Any, dict[str, str]]:
        """Its diagnostic_msgs/msg/DiagnosticStatus, and the values of this by key."""
        (status,) = topics.decode(topics.STATUS, self.raw[topics.STATUS]).status
        return status, {each.key: each.value for each in status.values}


@dataclass(frozen=True, slots=True)
class Request:
    """A recorded request to the loop, as for `HysteresisReduction.on_event`."""

    text: str
    raw: msg.Messages


@dataclass(frozen=True, eq=False)
class Log:
    """A log in memory, except its images, which are read from the file on demand.

    Attributes:
        segments: Which DOF moved when.
        versions: Versions of the software that wrote it.
        events: Index -> tick, update or request, in the loop's order. Indices start at 1; a
            missing index was dropped during recording or is damaged.
        warnings: Warnings in the log.
        damage: The parts that could not be read.
    """

    path: Path
    config: Config
    compensated: bool
    segments: tuple[Segment, ...]
    versions: dict[str, str]
    events: dict[int, Tick | Update | Request]
    warnings: tuple[str, ...]
    damage: Damage
    _images: dict[int, tuple[int, int]] = field(repr=False)
    """Index -> offset of the chunk in the file, and channel of the images."""

    def has_input(self, index: int) -> bool:
        """Whether the image or the measurement of an update is in the log."""
        event = self.events.get(index)
        return isinstance(event, Update) and (
            event.measurement is not None or self.has_image(index)
        )

    @cached_property
    def clock(self) -> msg.Clock:
        """Conversion from the rig's clock to the wall clock.

        Raises:
            RecordError: The log has no tick.
        """
        tick = next((event for event in self.events.values() if isinstance(event, Tick)), None)
        if tick is None:
            raise RecordError("log", str(self.path), "a log with a control tick")
        stamp = topics.decode(topics.APPLIED, tick.raw[topics.APPLIED]).header.stamp
        return msg.Clock(tick.sample.time, stamp.sec * 10**9 + stamp.nanosec)

    @property
    def missing(self) -> int:
        """Number of events missing before the last one."""
        return max(self.events, default=0) - len(self.events)

    def has_image(self, index: int) -> bool:
        """Whether the image of an update is in the log."""
        return index in self._images

    def image(self, index: int) -> NDArray[np.uint8]:
        """Read the image of an update; exact if `recording.image_format` is lossless.

        Raises:
            RecordError: It is not in the log, or not an image of the configured camera; or the file
                has changed since it was read.
        """
        if index not in self._images:
            raise RecordError(f"{self.path}: image", index, "an update with its image in the log")
        at, channel = self._images[index]
        with self.path.open("rb") as file:
            file.seek(at)
            records = [*itertools.islice(read_records(file, Damage()), 1)]
        messages = (each for _, opcode, payload in records for each in unpack(opcode, payload))
        found = (
            message.data
            for message in messages
            if isinstance(message, Message)
            and (message.channel_id, message.sequence) == (channel, index)
        )
        if (data := next(found, None)) is None:
            raise RecordError(f"{self.path}: image", index, "a file as it was when it was read")
        codec = ImageCodec(self.config.camera, self.config.recording)
        return codec.decode(topics.decode(topics.IMAGE, data).data.tobytes())

    def recording(self) -> Recording:
        """Trace and frames as `run_experiment` returned them; the snapshot is None."""
        recorder = RunRecorder(self.config)
        for event in self.events.values():
            if isinstance(event, Tick):
                recorder.add_tick(event.sample, event.reference, event.command)
            elif isinstance(event, Update):
                recorder.add_row(event.row, event.delta_minus, event.delta_plus)
        return Recording(*recorder.tables(), self.config, self.compensated, self.segments)


def read_log(path: str | PathLike[str]) -> Log:
    """Read a log, complete or truncated; see `Log.damage`.

    Raises:
        MissingPathError: There is no such file.
        RecordError: The file is not MCAP, not a log of tautscope, or has other degrees of freedom
            than its configuration.
        ConfigError: This version does not know its configuration.
    """
    file = Path(path)
    damage = Damage()
    groups: defaultdict[int, msg.Messages] = defaultdict(dict)
    images: dict[int, tuple[int, int]] = {}
    warnings: list[str] = []
    for offset, topic, record in read_messages(file, damage):
        if topic == topics.IMAGE:
            images[record.sequence] = offset, record.channel_id
        elif topic == topics.WARNING:
            warnings.append(topics.decode(topic, record.data).msg)
        elif topic in topics.TYPES:
            groups[record.sequence][topic] = record.data
    try:
        header = read_header(groups.pop(0, {}))
    except RecordError as error:
        raise RecordError(error.field, f"{file}: {error.value}", error.allowed) from None
    codec = msg.Codec(header[0])
    events: dict[int, Tick | Update | Request] = {}
    for index, messages in sorted(groups.items()):
        if messages.keys() >= topics.TICK_TOPICS:
            events[index] = Tick(*codec.read_tick(messages), messages)
        elif codec.is_update(messages):
            events[index] = Update(*codec.read_update(messages), messages)
        elif topics.EVENT in messages:
            text = topics.decode(topics.EVENT, messages[topics.EVENT]).data
            events[index] = Request(text, messages)
    shown = {index: location for index, location in images.items() if index in events}
    return Log(file, *header, events, tuple(warnings), damage, shown)
