"""The messages of a log: conversion of ticks, updates and requests to ROS 2, and back.

Header stamps are wall clock times [ns]; times of the rig's clock, which a replay needs exactly, are
float64 fields.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tautscope.config import Config
from tautscope.errors import RecordError
from tautscope.log import topics
from tautscope.log.cdr import Message
from tautscope.log.fields import (
    diagnostics,
    header_of,
    joint_state,
    multi_array,
    nanoseconds_of,
    offsets,
    stamp_of,
)
from tautscope.log.measurements import measurement_messages, read_measurement, value_names
from tautscope.loop.kinematics import Floats
from tautscope.loop.measurement import Measurement
from tautscope.loop.reduction import Report, Status
from tautscope.loop.rig import Frame, Sample
from tautscope.runs.recording import FEATURES, update_columns
from tautscope.runs.run_recorder import Row, update_row

Messages = dict[str, bytes]
"""Topic -> CDR."""

_WARN_LEVEL = 30  # of rcl_interfaces/msg/Log


@dataclass(frozen=True, slots=True)
class Clock:
    """Conversion from the rig's clock to the wall clock.

    Attributes:
        start: Rig time of the first tick [s].
        epoch: Wall clock time of the first tick [ns since 1970].
    """

    start: float
    epoch: int

    def nanoseconds(self, time: float) -> int:
        """The wall clock time [ns] of a rig time [s]; a rig time may be far off."""
        return max(self.epoch + nanoseconds_of(time - self.start), 0)


class Codec:
    """Conversion of the ticks and updates of a configuration; its DOFs name the numbers."""

    def __init__(self, config: Config) -> None:
        self._names = [dof.label for dof in config.dofs]
        own = topics.MEASUREMENT if config.dof else topics.MARKERS
        self._update_topics = topics.UPDATE_TOPICS | {own}
        self._columns = update_columns(config)

    def tick(
        self,
        clock: Clock,
        sample: Sample,
        reference: Iterable[float],
        command: Iterable[float],
        made_at: float | None = None,
    ) -> Messages:
        """The messages of a control tick; ``made_at`` is the rig time of its reference [s]."""
        header = header_of(clock.nanoseconds(sample.time), "")
        joints = {
            topics.REFERENCE: reference,
            topics.COMMAND: command,
            topics.APPLIED: sample.applied,
        }
        if sample.true_state is not None:
            joints[topics.TRUTH] = sample.true_state
        # The first message, so that a truncated log never has the other ones without it.
        messages = {} if made_at is None else {topics.MADE_AT: {"data": made_at}}
        messages |= {
            topic: joint_state(header, self._names, values) for topic, values in joints.items()
        }
        return topics.encode_all(messages | {topics.TICK: {"data": sample.time}})

    def read_tick(
        self, messages: Mapping[str, bytes]
    ) -> tuple[Sample, Floats, Floats, float | None]:
        """Read sample (without frame), reference, command and the time of the reference.

        Raises:
            RecordError: The degrees of freedom are not those of the configuration.
        """
        joints = {
            topic: self._positions(messages, topic)
            for topic in (topics.REFERENCE, topics.COMMAND, topics.APPLIED, topics.TRUTH)
            if topic in messages
        }
        time = _decoded(messages, topics.TICK).data
        sample = Sample(time, joints[topics.APPLIED], None, joints.get(topics.TRUTH))
        made_at = _decoded(messages, topics.MADE_AT).data if topics.MADE_AT in messages else None
        return sample, joints[topics.REFERENCE], joints[topics.COMMAND], made_at

    def update(
        self, clock: Clock, now: float, seen: Frame | Measurement, report: Report, count: int
    ) -> Messages:
        """The messages of an update; of an image all but the image, which is `image_message`.

        Args:
            clock: Of the run.
            now: Rig time of the update [s].
            seen: The frame or measurement.
            report: Result of the update.
            count: Number of the measurement in the run.
        """
        stamp = clock.nanoseconds(report.captured_at)
        row = update_row(self._columns, now, seen, report, count)
        numbers = {name: float(row[name]) for name in self._columns.names or () if name != "status"}
        if isinstance(seen, Frame):
            source, name, own = "endoscope", "images", {}
            features = [row[f"features_{name}"] for name in FEATURES]
            markers = {topics.MARKERS: multi_array({"a,b": 2, "u,v": 2}, features)}
        else:
            source, name, markers = f"sensor_{seen.sensor}", "measurements", {}
            own = measurement_messages(header_of(stamp, source), seen, self._names)
            for group, values in (
                ("predicted_values", report.predicted_features),
                ("innovation", report.innovation),
            ):
                names = value_names(seen, self._names)
                numbers |= zip((f"{group}_{each}" for each in names), values, strict=True)
        header = header_of(stamp, source)
        return topics.encode_all(
            {
                **own,
                topics.ESTIMATE: joint_state(header, self._names, report.state_estimate),
                topics.DELTA: offsets(self._names, report),
                **markers,
                topics.STATUS: self._status(header, name, report),
                topics.UPDATE: multi_array({",".join(numbers): len(numbers)}, numbers.values()),
            }
        )

    def read_update(
        self, messages: Mapping[str, bytes]
    ) -> tuple[Row, Floats, Floats, Measurement | None]:
        """Read an `update_row`, both offsets, and the measurement if it was no image.

        Columns unknown to the log's version are NaN or 0.

        Raises:
            RecordError: The degrees of freedom are not those of the configuration.
        """
        update = _decoded(messages, topics.UPDATE)
        names = update.layout.dim[0].label.split(",")
        known = dict(zip(names, update.data.tolist(), strict=True))
        known["status"] = _decoded(messages, topics.STATUS).status[0].message
        delta = _decoded(messages, topics.DELTA)
        self._check_names(topics.DELTA, delta.layout.dim[0].label.split(","))
        deltas = delta.data.reshape(len(self._names), 2)
        row = np.zeros(1, self._columns)[0]
        for name, (kind, *_) in (self._columns.fields or {}).items():
            row[name] = known.get(name, np.nan if kind.kind == "f" else 0)
        seen = read_measurement(messages, self._names) if topics.MEASUREMENT in messages else None
        return row, deltas[:, 0], deltas[:, 1], seen

    def is_update(self, messages: Mapping[str, bytes]) -> bool:
        """Whether these are all messages of an update; a log may be damaged."""
        return messages.keys() >= self._update_topics

    def _positions(self, messages: Mapping[str, bytes], topic: str) -> Floats:
        joints = _decoded(messages, topic)
        self._check_names(topic, joints.name)
        return np.array(joints.position)

    def _check_names(self, topic: str, found: Sequence[str]) -> None:
        if list(found) != self._names:
            allowed = f"the degrees of freedom of the configuration: {', '.join(self._names)}"
            raise RecordError(topic, ", ".join(found), allowed)

    def _status(self, header: Message, name: str, report: Report) -> dict[str, Any]:
        values = {
            f"trigger_{label}": ",".join(each or "none" for each in triggers)
            for label, triggers in zip(self._names, report.triggers, strict=True)
        }
        values |= {"reaction": str(report.reaction), "warnings": ",".join(report.warnings)}
        if (detection := report.detection) is not None:
            values |= zip(("reason_a", "reason_b"), detection.reasons, strict=True)
            values["discriminant"] = str(detection.discriminant)
        return diagnostics(
            header,
            values,
            level=0 if report.status is Status.OK else 1,
            name=name,
            message=str(report.status),
            hardware_id=header["frame_id"],
        )


def image_message(captured_at: int, image_format: str, data: bytes) -> bytes:
    """The message of a compressed image taken at a wall clock time [ns], in `ImageCodec.format`."""
    header = header_of(captured_at, "endoscope")
    return topics.encode(topics.IMAGE, {"header": header, "format": image_format, "data": data})


def request_messages(_: Clock, request: str) -> Messages:
    """The message of a request to the loop, as for `HysteresisReduction.on_event`."""
    return topics.encode_all({topics.EVENT: {"data": request}})


def warning_message(stamp: int, text: str) -> bytes:
    """The message of a warning."""
    fields: dict[str, Any] = {"stamp": stamp_of(stamp), "level": _WARN_LEVEL, "msg": text}
    return topics.encode(topics.WARNING, fields | {"name": "tautscope"})


def _decoded(messages: Mapping[str, bytes], topic: str) -> Any:
    return topics.decode(topic, messages[topic])
