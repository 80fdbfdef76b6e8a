"""Topics of a log and their ROS 2 message types; docs/recordings.md describes them.

Names follow CRTK.
"""

from collections.abc import Mapping
from typing import Any

from tautscope.log import cdr

TYPES: dict[str, str] = {}
"""Topic -> ROS 2 message type; the channels of a log are in this order."""


def _topic(name: str, kind: str) -> str:
    TYPES[name] = kind
    return name


CONFIG = _topic("/tautscope/config", "std_msgs/msg/String")
RUN = _topic("/tautscope/run", "std_msgs/msg/String")
VERSIONS = _topic("/tautscope/versions", "std_msgs/msg/String")
CAMERA_INFO = _topic("/endoscope/camera_info", "sensor_msgs/msg/CameraInfo")
REFERENCE = _topic("/instrument/servo_jp", "sensor_msgs/msg/JointState")
COMMAND = _topic("/instrument/actuators/setpoint_js", "sensor_msgs/msg/JointState")
APPLIED = _topic("/instrument/actuators/measured_js", "sensor_msgs/msg/JointState")
TRUTH = _topic("/twin/measured_js", "sensor_msgs/msg/JointState")
TICK = _topic("/tautscope/tick", "std_msgs/msg/Float64")
MADE_AT = _topic("/tautscope/made_at", "std_msgs/msg/Float64")
IMAGE = _topic("/endoscope/image_raw/compressed", "sensor_msgs/msg/CompressedImage")
ESTIMATE = _topic("/instrument/measured_js", "sensor_msgs/msg/JointState")
DELTA = _topic("/instrument/hysteresis/delta", "std_msgs/msg/Float64MultiArray")
MARKERS = _topic("/endoscope/markers", "std_msgs/msg/Float64MultiArray")
STATUS = _topic("/tautscope/status", "diagnostic_msgs/msg/DiagnosticArray")
UPDATE = _topic("/tautscope/image_update", "std_msgs/msg/Float64MultiArray")
EVENT = _topic("/tautscope/event", "std_msgs/msg/String")
WARNING = _topic("/tautscope/warning", "rcl_interfaces/msg/Log")
MEASUREMENT = _topic("/tautscope/measurement", "std_msgs/msg/Float64MultiArray")
COVARIANCE = _topic("/tautscope/measurement/covariance", "std_msgs/msg/Float64MultiArray")
POSE = _topic("/tip/measured_cp", "geometry_msgs/msg/PoseStamped")

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
