"""Which topics a log has, and what of a run is in them. docs/recordings.md has the table.

Joint names and topics follow CRTK. Header stamps are in nanoseconds of the wall clock; what a
replay needs to the last bit (the rig's clock) is a float64 beside them.
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
import tomli_w
from numpy.typing import NDArray

from tautscope._core import __version__
from tautscope.config import Config, dump_config, from_document
from tautscope.dof import Dof
from tautscope.errors import RecordError
from tautscope.log.cdr import Message, decode, encode
from tautscope.log.fields import header_of, joint_state, multi_array, stamp_of
from tautscope.loop.reduction import Report, Status
from tautscope.loop.references import Segment
from tautscope.loop.rig import Frame, Sample
from tautscope.runs.recording import FRAME_COLUMNS
from tautscope.runs.run_recorder import Row, frame_row

Floats = NDArray[np.float64]
Messages = dict[str, bytes]
"""Topic -> CDR."""

CONFIG = "/tautscope/config"
RUN = "/tautscope/run"
VERSIONS = "/tautscope/versions"
CAMERA_INFO = "/endoscope/camera_info"
REFERENCE = "/instrument/servo_jp"
COMMAND = "/instrument/actuators/setpoint_js"
APPLIED = "/instrument/actuators/measured_js"
TRUTH = "/twin/measured_js"
TICK = "/tautscope/tick"
MADE_AT = "/tautscope/made_at"
IMAGE = "/endoscope/image_raw/compressed"
ESTIMATE = "/instrument/measured_js"
DELTA = "/instrument/hysteresis/delta"
MARKERS = "/endoscope/markers"
STATUS = "/tautscope/status"
UPDATE = "/tautscope/image_update"
EVENT = "/tautscope/event"
WARNING = "/tautscope/warning"

TOPICS = {
    CONFIG: "std_msgs/msg/String",
    RUN: "std_msgs/msg/String",
    VERSIONS: "std_msgs/msg/String",
    CAMERA_INFO: "sensor_msgs/msg/CameraInfo",
    REFERENCE: "sensor_msgs/msg/JointState",
    COMMAND: "sensor_msgs/msg/JointState",
    APPLIED: "sensor_msgs/msg/JointState",
    TRUTH: "sensor_msgs/msg/JointState",
    TICK: "std_msgs/msg/Float64",
    MADE_AT: "std_msgs/msg/Float64",
    IMAGE: "sensor_msgs/msg/CompressedImage",
    ESTIMATE: "sensor_msgs/msg/JointState",
    DELTA: "std_msgs/msg/Float64MultiArray",
    MARKERS: "std_msgs/msg/Float64MultiArray",
    STATUS: "diagnostic_msgs/msg/DiagnosticArray",
    UPDATE: "std_msgs/msg/Float64MultiArray",
    EVENT: "std_msgs/msg/String",
    WARNING: "rcl_interfaces/msg/Log",
}
"""Topic -> type."""

OF_TICK = {REFERENCE, COMMAND, APPLIED, TICK}
OF_UPDATE = {ESTIMATE, DELTA, MARKERS, STATUS, UPDATE}
"""What makes a tick, and an image update, whole."""

_COLUMNS = FRAME_COLUMNS.names or ()
_NUMBERS = [name for name in _COLUMNS if FRAME_COLUMNS[name].kind != "U"]
_WARN_LEVEL = 30  # of rcl_interfaces/msg/Log


@dataclass(frozen=True, slots=True)
class Clock:
    """The rig's clock on the wall.

    Attributes:
        start: The rig's clock at the first tick [s].
        epoch: The wall clock then [ns since 1970].
    """

    start: float
    epoch: int

    def nanoseconds(self, time: float) -> int:
        """A time of the rig's clock [s] as one of the wall's [ns]."""
        return self.epoch + round((time - self.start) * 1e9)


@dataclass(frozen=True, slots=True)
class Facts:
    """What is said of a run before it begins: all that a replay depends on, and segments."""

    config: Config
    compensated: bool
    segments: tuple[Segment, ...]


def head_messages(facts: Facts, stamp: int) -> Messages:
    """Configuration, run, versions and camera."""
    config = facts.config
    run = {
        "compensated": facts.compensated,
        "segments": [
            {"dof": s.dof.label, "start": s.start, "period": s.period, "periods": s.periods}
            for s in facts.segments
        ],
    }
    versions = {
        "tautscope": __version__,
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}",
        **{name: version(name) for name in ("numpy", "opencv-python-headless", "mcap")},
    }
    texts = {CONFIG: dump_config(config), RUN: tomli_w.dumps(run), VERSIONS: json.dumps(versions)}
    messages = {topic: _encoded(topic, {"data": text}) for topic, text in texts.items()}
    camera = config.camera
    intrinsics = (camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0)
    window = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
    messages[CAMERA_INFO] = _encoded(
        CAMERA_INFO,
        {
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
        },
    )
    return messages


def read_head(messages: Mapping[str, bytes]) -> tuple[Facts, dict[str, str]]:
    """Facts and versions, from the messages of `head_messages`.

    Raises:
        RecordError: One is missing or not as written there.
        ConfigError: The configuration has a key that this version does not know.
    """
    try:
        texts = {
            topic: decode(TOPICS[topic], messages[topic])["data"]
            for topic in (CONFIG, RUN, VERSIONS)
        }
        run = tomllib.loads(texts[RUN])
        segments = tuple(
            Segment(Dof[s["dof"].upper()], s["start"], s["period"], s["periods"])
            for s in run["segments"]
        )
        document = tomllib.loads(texts[CONFIG])
        compensated, versions = bool(run["compensated"]), json.loads(texts[VERSIONS])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        allowed = f"a log of tautscope, with {CONFIG}, {RUN} and {VERSIONS}"
        raise RecordError("log", f"{type(error).__name__}: {error}", allowed) from None
    return Facts(from_document(document), compensated, segments), versions


def tick_messages(
    clock: Clock,
    sample: Sample,
    reference: Iterable[float],
    command: Iterable[float],
    made_at: float | None = None,
) -> Messages:
    """One control tick; when its reference was made [s, the rig's clock], if that is known."""
    header = header_of(clock.nanoseconds(sample.time), "")
    joints = {REFERENCE: reference, COMMAND: command, APPLIED: sample.applied}
    if sample.true_state is not None:
        joints[TRUTH] = sample.true_state
    # The date first: where a torn log has the rest of a tick, it has its date.
    messages = {} if made_at is None else {MADE_AT: _encoded(MADE_AT, {"data": made_at})}
    messages |= {
        topic: _encoded(topic, joint_state(header, values)) for topic, values in joints.items()
    }
    messages[TICK] = _encoded(TICK, {"data": sample.time})
    return messages


def read_tick(messages: Mapping[str, bytes]) -> tuple[Sample, Floats, Floats, float | None]:
    """Sample without its frame, reference, command, and when the reference was made."""
    joints = {
        topic: np.array(decode(TOPICS[topic], messages[topic])["position"], np.float64)
        for topic in (REFERENCE, COMMAND, APPLIED, TRUTH)
        if topic in messages
    }
    time = decode(TOPICS[TICK], messages[TICK])["data"]
    sample = Sample(time, joints[APPLIED], None, joints.get(TRUTH))
    made_at = decode(TOPICS[MADE_AT], messages[MADE_AT])["data"] if MADE_AT in messages else None
    return sample, joints[REFERENCE], joints[COMMAND], made_at


def update_messages(clock: Clock, now: float, frame: Frame, report: Report) -> Messages:
    """What the loop made of an image; the image itself is `image_message`."""
    captured = header_of(clock.nanoseconds(report.captured_at), "endoscope")
    row = dict(zip(_COLUMNS, frame_row(now, frame, report), strict=True))
    numbers = [float(row[name]) for name in _NUMBERS]  # type: ignore[arg-type]
    features = [row[f"features_{name}"] for name in ("a_x", "a_y", "b_x", "b_y")]
    deltas = np.stack([report.delta_minus, report.delta_plus], axis=1).ravel()
    return {
        ESTIMATE: _encoded(ESTIMATE, joint_state(captured, report.state_estimate)),
        DELTA: _encoded(
            DELTA, multi_array({"insertion,rotation,bending": 3, "minus,plus": 2}, deltas)
        ),
        MARKERS: _encoded(MARKERS, multi_array({"a,b": 2, "u,v": 2}, features)),
        STATUS: _status(captured, report),
        UPDATE: _encoded(UPDATE, multi_array({",".join(_NUMBERS): len(_NUMBERS)}, numbers)),
    }


def read_update(messages: Mapping[str, bytes]) -> tuple[Row, Floats, Floats]:
    """A `frame_row`, and the offsets after it; NaN or 0 in columns its version had not."""
    update = decode(TOPICS[UPDATE], messages[UPDATE])
    known = dict(zip(update["layout"]["dim"][0]["label"].split(","), update["data"], strict=True))
    known["status"] = decode(TOPICS[STATUS], messages[STATUS])["status"][0]["message"]
    deltas = np.array(decode(TOPICS[DELTA], messages[DELTA])["data"], np.float64).reshape(3, 2)
    row = tuple(
        kind.type(known.get(name, np.nan if kind.kind == "f" else 0)).item()
        for name, kind in ((name, FRAME_COLUMNS[name]) for name in _COLUMNS)
    )
    return row, deltas[:, 0], deltas[:, 1]


def image_message(clock: Clock, captured_at: float, picture: str, data: bytes) -> bytes:
    """A compressed image: its format in image_transport's words, and its bytes."""
    header = header_of(clock.nanoseconds(captured_at), "endoscope")
    return _encoded(IMAGE, {"header": header, "format": picture, "data": data})


def event_messages(what: str) -> Messages:
    """What the loop was told, as `HysteresisReduction.on_event`."""
    return {EVENT: _encoded(EVENT, {"data": what})}


def warning_message(stamp: int, text: str) -> bytes:
    """A line for the log panel of a viewer."""
    fields: dict[str, Any] = {"stamp": stamp_of(stamp), "level": _WARN_LEVEL, "msg": text}
    return _encoded(WARNING, fields | {"name": "tautscope", "file": "", "function": "", "line": 0})


def _status(header: Message, report: Report) -> bytes:
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
    return _encoded(STATUS, {"header": header, "status": [status]})


def _encoded(topic: str, message: Message) -> bytes:
    return encode(TOPICS[topic], message)
