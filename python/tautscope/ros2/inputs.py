"""Checks of received messages, and conversion to what the loop takes.

A `MessageError` names the topic and the field; the message then changes nothing.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tautscope.config import CameraConfig
from tautscope.errors import ConfigError, MessageError
from tautscope.loop.frame_layout import FrameLayout
from tautscope.loop.kinematics import Floats
from tautscope.loop.rig import Frame

FUTURE = 5_000_000
"""How much later than this computer's clock a stamp may be [ns]."""
ENCODINGS = {
    "bgr": ("bgr8",),
    "rgb": ("rgb8",),
    "bgra": ("bgra8",),
    "yuyv": ("yuv422_yuy2",),
    "uyvy": ("uyvy", "yuv422"),
    "nv12": ("nv12",),
}
"""`camera.pixel_format` -> values of ``encoding``, of sensor_msgs/image_encodings.hpp."""


class Stamps:
    """Checks that messages are of one publisher, with stamps known, of the present, and later."""

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self._last = 0
        self._source: bytes | None = None

    def reset(self) -> None:
        """Forget stamp and publisher: the sender's clock may have been set."""
        self._last = 0
        self.release()

    def release(self) -> None:
        """Take the next publisher."""
        self._source = None

    def check(self, header: Any, wall: int, source: bytes = b"") -> int:
        """As `checked_stamp`, if it is later than the last one and of the same publisher."""
        if self._source not in (None, source):
            allowed = "the publisher that was the first after `enable` or `resume`"
            raise MessageError(f"{self._topic} publisher", source.hex(), allowed)
        stamp = checked_stamp(self._topic, header, wall)
        if stamp <= self._last:
            allowed = "a later time than that of the last message"
            raise MessageError(f"{self._topic} header.stamp", f"{stamp / 1e9:.9f} s", allowed)
        self._last, self._source = stamp, source
        return stamp


def checked_stamp(topic: str, header: Any, wall: int) -> int:
    """The stamp [ns since 1970] of a header that arrived at a wall clock time [ns].

    Raises:
        MessageError: It is 0 (CRTK: invalid data), no time, or in the future.
    """
    sec, nanosec = header.stamp.sec, header.stamp.nanosec
    stamp = int(sec * 10**9 + nanosec)
    allowed = ""
    if sec < 0 or nanosec >= 10**9 or stamp == 0:
        allowed = "a time above 0 with less than 10^9 ns; 0 marks invalid data"
    elif stamp > wall + FUTURE:
        ahead = (stamp - wall) / 1e9
        allowed = f"no time in the future (by {ahead:.3f} s): synchronise the clocks"
    if allowed:
        raise MessageError(f"{topic} header.stamp", f"{sec}.{nanosec:09d} s", allowed)
    return stamp


def joint_positions(topic: str, message: Any, joints: Sequence[str]) -> Floats:
    """Positions (n,) [m or rad] of the joints in a JointState, in their order, all of them."""
    if sorted(message.name) != sorted(joints):
        allowed = f"{', '.join(joints)}, in any order"
        raise MessageError(f"{topic} name", list(message.name)[:9], allowed)
    found = known_positions(topic, message, joints)
    for name, position in zip(joints, found, strict=True):
        if np.isnan(position):
            raise MessageError(f"{topic} position of {name}", position, "a finite number")
    return found


def known_positions(topic: str, message: Any, joints: Sequence[str]) -> Floats:
    """Positions (n,) [m or rad] of the joints in a JointState; NaN for one that is missing."""
    names, positions = list(message.name), message.position
    if not names or len(set(names)) < len(names) or not set(names) <= set(joints):
        raise MessageError(f"{topic} name", names[:9], f"of {', '.join(joints)}, each once")
    if len(positions) != len(names):
        raise MessageError(f"{topic} position", len(positions), f"{len(names)} numbers, one a name")
    for name, position in zip(names, positions, strict=True):
        if np.isinf(position):
            raise MessageError(f"{topic} position of {name}", float(position), "a finite number")
    found = dict(zip(names, positions, strict=True))
    return np.array([found.get(joint, np.nan) for joint in joints], np.float64)


@dataclass(frozen=True, slots=True)
class JoyAxes:
    """Index in ``axes`` for each degree of freedom, in ``buttons`` of the dead man's button."""

    axes: tuple[int, ...] = (1, 0, 4)
    button: int = 4


def joy_deflection(topic: str, message: Any, layout: JoyAxes) -> tuple[Floats, bool]:
    """Deflections (n,) from -1 to 1, and whether the dead man's button is held."""
    axes, buttons = message.axes, message.buttons
    for name, values, least in (
        ("axes", axes, max(layout.axes)),
        ("buttons", buttons, layout.button),
    ):
        if len(values) <= least:
            raise MessageError(f"{topic} {name}", len(values), f"at least {least + 1} values")
    deflection = np.array([axes[index] for index in layout.axes], np.float64)
    if not (np.abs(deflection) <= 1).all():
        raise MessageError(f"{topic} axes", deflection.tolist(), "numbers from -1 to 1")
    return deflection, bool(buttons[layout.button])


class ImageReader:
    """Converts images of ROS to frames of the configured camera, if ROS has its pixel format."""

    def __init__(self, topic: str, camera: CameraConfig) -> None:
        self._topic, self._camera = topic, camera
        self._shape = FrameLayout(camera).shape
        if camera.pixel_format not in ENCODINGS:
            allowed = f"one of {', '.join(ENCODINGS)} for images of ROS"
            raise ConfigError("camera.pixel_format", camera.pixel_format, allowed)

    def read(self, message: Any, captured_at: float, sequence: int) -> Frame:
        """The frame of an image, without a copy, captured at a time of the rig's clock [s]."""
        topic, camera = self._topic, self._camera
        encodings = ENCODINGS[camera.pixel_format]
        if message.encoding not in encodings:
            allowed = f"{' or '.join(encodings)}: camera.pixel_format is {camera.pixel_format}"
            raise MessageError(f"{topic} encoding", message.encoding[:32], allowed)
        for field, size in (("width", camera.width), ("height", camera.height)):
            if getattr(message, field) != size:
                raise MessageError(f"{topic} {field}", getattr(message, field), f"{size} px")
        count, length = self._shape[0], math.prod(self._shape[1:])
        if message.step < length:
            raise MessageError(f"{topic} step", message.step, f"at least {length} bytes a line")
        if len(message.data) != message.step * count:
            allowed = f"step x {count} lines = {message.step * count} bytes"
            raise MessageError(f"{topic} data", f"{len(message.data)} bytes", allowed)
        lines = np.frombuffer(message.data, np.uint8).reshape(count, message.step)
        return Frame(lines[:, :length].reshape(self._shape), captured_at, sequence)
