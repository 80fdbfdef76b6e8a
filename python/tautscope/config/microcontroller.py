"""What a section ``drives`` has by default: behind a microcontroller, and of every motor."""

from __future__ import annotations

from typing import Any

from tautscope.config.servos import LAG, PORTS, with_motor_defaults

PROTOCOL = "serial"
"""``drives.protocol`` of the serial line protocol, docs/serial.md."""
SERIAL_PORTS = PORTS | {PROTOCOL: "/dev/ttyACM0"}
"""Protocols on a serial port, none of them CiA 402, and the port on Linux."""
MOST_AXES = 8
"""Largest number of axes of a microcontroller."""
_BITRATE = 250_000
"""`DrivesConfig.bitrate` [bit/s], which the 16 MHz of an Arduino divide exactly."""
_FOLLOWING_SHARE = 0.01
"""`AxisConfig.following_error` over the width of the travel."""


def with_axis_defaults(drives: dict[str, Any]) -> dict[str, Any]:
    """The document of a section ``drives``, with the defaults of any motor and the serial line."""
    line = {"channel": SERIAL_PORTS[PROTOCOL], "bitrate": _BITRATE, "lag": LAG}
    filled = (line if drives.get("protocol") == PROTOCOL else {}) | drives
    return with_motor_defaults(filled, _with_defaults)


def _with_defaults(_: str, axis: dict[str, Any]) -> dict[str, Any]:
    defaults: dict[str, Any] = {"sign": 1}
    match axis.get("travel"):
        case [float() | int() as lower, float() | int() as upper] if lower < upper:
            defaults["following_error"] = _FOLLOWING_SHARE * (upper - lower)
    defaults |= axis
    match defaults.get("following_error"):
        case float() | int() as error:
            defaults = {"following_window": error / 2} | defaults
    return defaults
