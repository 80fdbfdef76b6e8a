"""What a section ``drives`` has by default if its motors are behind a microcontroller."""

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


def with_microcontroller_defaults(drives: dict[str, Any]) -> dict[str, Any]:
    """The document of a section ``drives``, with the defaults of the serial line if it has one."""
    if drives.get("protocol") != PROTOCOL:
        return drives
    filled = {"channel": SERIAL_PORTS[PROTOCOL], "bitrate": _BITRATE, "lag": LAG, **drives}
    return with_motor_defaults(filled, _with_defaults)


def _with_defaults(_: str, axis: dict[str, Any]) -> dict[str, Any]:
    defaults: dict[str, Any] = {"sign": 1}
    match axis.get("travel"):
        case [float() | int() as lower, float() | int() as upper] if lower < upper:
            error = _FOLLOWING_SHARE * (upper - lower)
            defaults |= {"following_error": error, "following_window": error / 2}
    return defaults | axis
