"""Models of servos, and what their drives section has by default."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from tautscope.dof import Dof
from tautscope.errors import ConfigError

COUNTS_PER_TURN = 4096
"""Resolution of every servo here [counts per turn of the horn]."""


@dataclass(frozen=True, slots=True)
class ServoModel:
    """A model of a servo.

    Attributes:
        protocol: ``drives.protocol`` for it.
        number: Its model number.
        speed: Speed without load at the recommended voltage [1/min], from its manual.
    """

    protocol: str
    number: int
    speed: float


MODELS = {
    "XL330-M077": ServoModel("dynamixel", 1190, 383),
    "XL330-M288": ServoModel("dynamixel", 1200, 103),
    "XC330-T288": ServoModel("dynamixel", 1220, 65),
    "XL430-W250": ServoModel("dynamixel", 1060, 57),
    "XM430-W350": ServoModel("dynamixel", 1020, 46),
    "XM430-W210": ServoModel("dynamixel", 1030, 77),
    "STS3215": ServoModel("feetech", 777, 50),
}
"""Servos that are known, by the names of their makers."""
PORTS = {"dynamixel": "/dev/ttyUSB0", "feetech": "/dev/ttyACM0"}
"""Protocols of servos, and the serial port of the makers' adapters on Linux."""
LAG = 0.06
"""`DrivesConfig.lag` of servos [s]: their position loops lag more than those of drives."""
_SPEED_SHARE = 0.8
"""Speed limit over the speed without load."""
_FOLLOWING_ERROR = 64
"""Default of `AxisConfig.following_error` [counts]: 5.6 degrees of the horn."""


def models_of(protocol: str) -> tuple[str, ...]:
    """Names of the models with a protocol."""
    return tuple(name for name, model in MODELS.items() if model.protocol == protocol)


def with_servo_defaults(drives: dict[str, Any]) -> dict[str, Any]:
    """The document of a section ``drives``, with the defaults of its servos if it has any.

    A horn that is the DOF itself turns by 1 rad per rad; a motor of insertion, or of another unit
    than rad, has no default of ``counts_per_unit``.

    Raises:
        ConfigError: A model is unknown, or of another protocol.
    """
    protocol = drives.get("protocol")
    if protocol not in PORTS:
        return drives
    filled = {"channel": PORTS[protocol], "lag": LAG, **drives}

    def with_defaults(key: str, axis: dict[str, Any]) -> dict[str, Any]:
        name = axis.get("model")
        if name not in models_of(protocol):
            allowed = "one of " + ", ".join(models_of(protocol))
            raise ConfigError(f"{key}.model", name, allowed)
        is_angle = axis.get("unit", "rad") == "rad" and key != Dof.INSERTION.key
        return _with_defaults(axis, MODELS[name], is_angle=is_angle)

    return with_motor_defaults(filled, with_defaults)


def with_motor_defaults(
    drives: dict[str, Any], with_defaults: Callable[[str, dict[str, Any]], dict[str, Any]]
) -> dict[str, Any]:
    """A copy of the document of a section ``drives``, with defaults of its motors.

    Args:
        drives: The document; what has the wrong type is refused later.
        with_defaults: From key and document of a motor to that with its defaults.
    """

    def each(place: str, motors: Any, names: Iterable[str]) -> dict[str, Any]:
        found = {name: motors[name] for name in names if isinstance(motors.get(name), dict)}
        return {name: with_defaults(f"{place}.{name}", own) for name, own in found.items()}

    filled = drives | each("drives", drives, [dof.label for dof in Dof])
    if isinstance(own := drives.get("motors"), dict):
        filled["motors"] = own | each("drives.motors", own, own)
    return filled


def _with_defaults(axis: dict[str, Any], model: ServoModel, *, is_angle: bool) -> dict[str, Any]:
    radian = {"counts_per_unit": COUNTS_PER_TURN / (2 * math.pi)} if is_angle else {}
    filled = {**radian, **axis}
    counts = filled.get("counts_per_unit")
    if not isinstance(counts, int | float) or counts <= 0:
        return filled  # refused when it is checked
    turns = _SPEED_SHARE * model.speed / 60
    return {
        "speed_limit": turns * COUNTS_PER_TURN / counts,
        "following_error": _FOLLOWING_ERROR / counts,
        **filled,
    }
