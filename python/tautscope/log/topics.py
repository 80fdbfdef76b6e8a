"""Topics of a log and their ROS 2 message types; docs/recordings.md describes them.

Names follow CRTK.
"""

from collections.abc import Mapping
from typing import Any

from tautscope.log import cdr

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
MEASUREMENT = "/tautscope/measurement"
COVARIANCE = "/tautscope/measurement/covariance"
POSE = "/tip/measured_cp"
STATUS = "/tautscope/status"
UPDATE = "/tautscope/image_update"
EVENT = "/tautscope/event"
WARNING = "/tautscope/warning"

TYPES = {
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
    MEASUREMENT: "std_msgs/msg/Float64MultiArray",
    COVARIANCE: "std_msgs/msg/Float64MultiArray",
    POSE: "geometry_msgs/msg/PoseStamped",
}
"""Topic -> ROS 2 message type."""

TICK_TOPICS = {REFERENCE, COMMAND, APPLIED, TICK}
"""Topics that every control tick has."""
UPDATE_TOPICS = {ESTIMATE, DELTA, STATUS, UPDATE}
"""Topics that every update has, beside `MARKERS` of an image or `MEASUREMENT`."""


def encode(topic: str, message: cdr.Message) -> bytes:
    """A message of a topic as CDR."""
    return cdr.encode(cdr.make(TYPES[topic], **message))


def encode_all(messages: Mapping[str, cdr.Message]) -> dict[str, bytes]:
    """Messages by topic as CDR."""
    return {topic: encode(topic, message) for topic, message in messages.items()}


def decode(topic: str, data: bytes) -> Any:
    """The message of a topic from CDR; errors as `cdr.decode`."""
    return cdr.decode(TYPES[topic], data)
