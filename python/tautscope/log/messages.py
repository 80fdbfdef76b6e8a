"""The messages of a log: conversion of ticks, image updates and requests to ROS 2, and back.

Header stamps are wall clock times [ns]; times of the rig's clock, which a replay needs exactly, are
float64 fields.
"""

from __future__ import annotations

import json
import platform
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from tautscope._core import __version__
from tautscope.config import Config, dump_config, from_document
from tautscope.dof import Dof
from tautscope.errors import RecordError
from tautscope.log import topics
from tautscope.log.cdr import Message
from tautscope.log.fields import header_of, joint_state, multi_array, stamp_of
from tautscope.loop.reduction import Report, Status
from tautscope.loop.references import Segment
from tautscope.loop.rig import Frame, Sample
from tautscope.runs.recording import FRAME_COLUMNS
from tautscope.runs.run_recorder import Row, frame_row

Floats = NDArray[np.float64]
Messages = dict[str, bytes]
"""Topic -> CDR."""

_COLUMNS = FRAME_COLUMNS.names or ()
_NUMBERS = [name for name in _COLUMNS if FRAME_COLUMNS[name].kind != "U"]
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
        """The wall clock time [ns] of a rig time [s]."""
        return self.epoch + round((time - self.start) * 1e9)


@dataclass(frozen=True, slots=True)
class RunInfo:
    """The data of a run that are known before it starts."""

    config: Config
    compensated: bool
    segments: tuple[Segment, ...]


def header_messages(info: RunInfo, stamp: int) -> Messages:
    """The messages at the start of a log: configuration, run, versions and camera."""
    config = info.config
    run = {
        "compensated": info.compensated,
        "segments": [
            {"dof": s.dof.label, "start": s.start, "period": s.period, "periods": s.periods}
            for s in info.segments
        ],
    }
    versions = {
        "tautscope": __version__,
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        **{name: version(name) for name in ("numpy", "opencv-python-headless", "mcap")},
    }
    camera = config.camera
    intrinsics = (camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0)
    window = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
    camera_info = {
        "header": header_of(stamp, "endoscope"),
        "height": camera.height,
        "width": camera.width,
        "distortion_model": "rational_polynomial",
        "d": camera.distortion,
        "k": intrinsics,
        "r": (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        "p": (camera.fx, 0.0, camera.cx, 0.0, 0.0, camera.fy, camera.cy, *[0.0] * 3, 1.0, 0.0),
        "binning_x": 0,
        "binning_y": 0,
        "roi": window,
    }
    return _encoded(
        {
            topics.CONFIG: {"data": dump_config(config)},
            topics.RUN: {"data": tomlkit.dumps(run)},
            topics.VERSIONS: {"data": json.dumps(versions)},
            topics.CAMERA_INFO: camera_info,
        }
    )


def read_header(messages: Mapping[str, bytes]) -> tuple[RunInfo, dict[str, str]]:
    """Read run data and versions from the messages of `header_messages`.

    Raises:
        RecordError: A message is missing or invalid.
        ConfigError: The configuration has a key that this version does not know.
    """
    try:
        texts = {
            topic: _decoded(messages, topic)["data"]
            for topic in (topics.CONFIG, topics.RUN, topics.VERSIONS)
        }
        run = tomllib.loads(texts[topics.RUN])
        segments = tuple(
            Segment(Dof[s["dof"].upper()], s["start"], s["period"], s["periods"])
            for s in run["segments"]
        )
        document = tomllib.loads(texts[topics.CONFIG])
        compensated, versions = bool(run["compensated"]), json.loads(texts[topics.VERSIONS])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        allowed = f"a log of tautscope, with {topics.CONFIG}, {topics.RUN} and {topics.VERSIONS}"
        raise RecordError("log", f"{type(error).__name__}: {error}", allowed) from None
    return RunInfo(from_document(document), compensated, segments), versions


def tick_messages(
    clock: Clock,
    sample: Sample,
    reference: Iterable[float],
    command: Iterable[float],
    made_at: float | None = None,
) -> Messages:
    """The messages of a control tick; ``made_at`` is the rig time of its reference [s]."""
    header = header_of(clock.nanoseconds(sample.time), "")
    joints = {topics.REFERENCE: reference, topics.COMMAND: command, topics.APPLIED: sample.applied}
    if sample.true_state is not None:
        joints[topics.TRUTH] = sample.true_state
    # The first message, so that a truncated log never has the other ones without it.
    messages = {} if made_at is None else {topics.MADE_AT: {"data": made_at}}
    messages |= {topic: joint_state(header, values) for topic, values in joints.items()}
    return _encoded(messages | {topics.TICK: {"data": sample.time}})


def read_tick(messages: Mapping[str, bytes]) -> tuple[Sample, Floats, Floats, float | None]:
    """Read sample (without frame), reference, command and the time of the reference."""
    joints = {
        topic: np.array(_decoded(messages, topic)["position"], np.float64)
        for topic in (topics.REFERENCE, topics.COMMAND, topics.APPLIED, topics.TRUTH)
        if topic in messages
    }
    time = _decoded(messages, topics.TICK)["data"]
    sample = Sample(time, joints[topics.APPLIED], None, joints.get(topics.TRUTH))
    made_at = _decoded(messages, topics.MADE_AT)["data"] if topics.MADE_AT in messages else None
    return sample, joints[topics.REFERENCE], joints[topics.COMMAND], made_at


def update_messages(clock: Clock, now: float, frame: Frame, report: Report) -> Messages:
    """The messages with the results of an image update; the image itself is `image_message`."""
    captured = header_of(clock.nanoseconds(report.captured_at), "endoscope")
    row = dict(zip(_COLUMNS, frame_row(now, frame, report), strict=True))
    numbers = [float(row[name]) for name in _NUMBERS]  # type: ignore[arg-type]
    features = [row[f"features_{name}"] for name in ("a_x", "a_y", "b_x", "b_y")]
    deltas = np.stack([report.delta_minus, report.delta_plus], axis=1).ravel()
    return _encoded(
        {
            topics.ESTIMATE: joint_state(captured, report.state_estimate),
            topics.DELTA: multi_array({"insertion,rotation,bending": 3, "minus,plus": 2}, deltas),
            topics.MARKERS: multi_array({"a,b": 2, "u,v": 2}, features),
            topics.STATUS: _status(captured, report),
            topics.UPDATE: multi_array({",".join(_NUMBERS): len(_NUMBERS)}, numbers),
        }
    )


def read_update(messages: Mapping[str, bytes]) -> tuple[Row, Floats, Floats]:
    """Read a `frame_row` and both offsets; columns unknown to the log's version are NaN or 0."""
    update = _decoded(messages, topics.UPDATE)
    known = dict(zip(update["layout"]["dim"][0]["label"].split(","), update["data"], strict=True))
    known["status"] = _decoded(messages, topics.STATUS)["status"][0]["message"]
    deltas = np.array(_decoded(messages, topics.DELTA)["data"], np.float64).reshape(3, 2)
    row = tuple(
        kind.type(known.get(name, np.nan if kind.kind == "f" else 0)).item()
        for name, kind in ((name, FRAME_COLUMNS[name]) for name in _COLUMNS)
    )
    return row, deltas[:, 0], deltas[:, 1]


def image_message(clock: Clock, captured_at: float, image_format: str, data: bytes) -> bytes:
    """The message of a compressed image; the format is that of image_transport."""
    header = header_of(clock.nanoseconds(captured_at), "endoscope")
    return topics.encode(topics.IMAGE, {"header": header, "format": image_format, "data": data})


def request_messages(request: str) -> Messages:
    """The message of a request to the loop, as for `HysteresisReduction.on_event`."""
    return _encoded({topics.EVENT: {"data": request}})


def warning_message(stamp: int, text: str) -> bytes:
    """The message of a warning."""
    fields: dict[str, Any] = {"stamp": stamp_of(stamp), "level": _WARN_LEVEL, "msg": text}
    return topics.encode(
        topics.WARNING, fields | {"name": "tautscope", "file": "", "function": "", "line": 0}
    )


def _status(header: Message, report: Report) -> dict[str, Any]:
    values = {
        f"trigger_{dof.label}": ",".join(each or "none" for each in triggers)
        for dof, triggers in zip(Dof, report.triggers, strict=True)
    }
    values |= {"reaction": str(report.reaction), "warnings": ",".join(report.warnings)}
    if report.detection is not None:
        values |= {
            "reason_a": report.detection.reasons[0],
            "reason_b": report.detection.reasons[1],
            "discriminant": str(report.detection.discriminant),
        }
    status = {
        "level": 0 if report.status is Status.OK else 1,
        "name": "images",
        "message": str(report.status),
        "hardware_id": "endoscope",
        "values": [{"key": key, "value": value} for key, value in values.items()],
    }
    return {"header": header, "status": [status]}


def _encoded(messages: Mapping[str, Message]) -> Messages:
    return {topic: topics.encode(topic, message) for topic, message in messages.items()}


def _decoded(messages: Mapping[str, bytes], topic: str) -> dict[str, Any]:
    return topics.decode(topic, messages[topic])
