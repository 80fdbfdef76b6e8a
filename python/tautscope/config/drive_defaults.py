"""What a section ``drives`` has by default: of its preset, its protocol, and each motor."""

import math
import tomllib
from pathlib import Path
from typing import Any, get_args

from tautscope.config.drives import Preset
from tautscope.config.microcontroller import PROTOCOL, SERIAL_PORTS
from tautscope.config.servos import COUNTS_PER_TURN, MODELS, PORTS, models_of
from tautscope.dof import Dof
from tautscope.errors import ConfigError

FOLDER = Path(__file__).with_name("drive_presets")
"""A file for each preset of a maker's drives, which says where its settings are from."""
_LAG = 0.06
"""`DrivesConfig.lag` on a serial port [s]: servos lag more than drives."""
_BITRATE = 250_000
"""`DrivesConfig.bitrate` [bit/s], which the 16 MHz of an Arduino divide exactly."""
_SPEED_SHARE = 0.8
"""Speed limit of a servo over its speed without load, which falls with its torque limit."""
_FOLLOWING_COUNTS, _FOLLOWING_SHARE = 64, 0.01
"""`AxisConfig.following_error` of a servo [counts], 5.6 degrees of the horn; of others over the
width of the travel."""


def with_drive_defaults(drives: dict[str, Any]) -> dict[str, Any]:
    """The document of a section ``drives`` over its defaults; what has the wrong type stays.

    Its keys replace those of its preset, except that its waivers are added.

    Raises:
        ConfigError: A model of a servo is unknown, or of another protocol.
    """
    protocol, preset = str(drives.get("protocol")), drives.get("preset")
    defaults: dict[str, Any] = {}
    if protocol in SERIAL_PORTS:
        defaults = {"channel": SERIAL_PORTS[protocol], "lag": _LAG}
    if protocol == PROTOCOL:
        defaults["bitrate"] = _BITRATE
    filled = defaults | drives
    if preset in get_args(Preset):
        of_preset = tomllib.loads((FOLDER / f"{preset}.toml").read_text(encoding="utf-8"))
        own = drives.get("waive", [])
        if isinstance(own, list | tuple) and all(isinstance(code, str) for code in own):
            own = list(dict.fromkeys([*of_preset.get("waive", []), *own]))
        filled = of_preset | filled | {"waive": own}
    for dof in Dof:
        _fill(filled, dof.label, dof.key, protocol)
    if isinstance(motors := drives.get("motors"), dict):
        filled["motors"] = dict(motors)
        for name in motors:
            _fill(filled["motors"], name, f"drives.motors.{name}", protocol)
    return filled


def _fill(motors: dict[str, Any], name: str, key: str, protocol: str) -> None:
    """Replace the document of a motor by one with its defaults."""
    if not isinstance(motor := motors.get(name), dict):
        return
    of_servo = _of_servo(key, motor, protocol) if protocol in PORTS else {}
    filled = {"sign": 1} | of_servo | motor
    match filled.get("travel"):
        case [float() | int() as lower, float() | int() as upper] if lower < upper:
            filled = {"following_error": _FOLLOWING_SHARE * (upper - lower)} | filled
    match filled.get("following_error"):
        case float() | int() as error if error > 0:
            filled = {"following_window": error / 2} | filled
    motors[name] = filled


def _of_servo(key: str, motor: dict[str, Any], protocol: str) -> dict[str, Any]:
    """Defaults of a servo.

    A horn that is the DOF itself turns by 1 rad per rad; a motor of insertion, or of another unit
    than rad, has no default of ``counts_per_unit``.
    """
    model = motor.get("model")
    if model not in models_of(protocol):
        raise ConfigError(f"{key}.model", model, "one of " + ", ".join(models_of(protocol)))
    is_angle = motor.get("unit", "rad") == "rad" and key != Dof.INSERTION.key
    radian = {"counts_per_unit": COUNTS_PER_TURN / (2 * math.pi)} if is_angle else {}
    counts: Any = (radian | motor).get("counts_per_unit")
    torque = motor.get("torque_limit", 1.0)
    are_numbers = isinstance(counts, int | float) and isinstance(torque, int | float)
    if not (are_numbers and counts > 0 and 0 < torque <= 1):
        return radian  # refused when it is checked
    turns = _SPEED_SHARE * torque * MODELS[model].speed / 60
    speed = turns * COUNTS_PER_TURN / counts
    return radian | {"speed_limit": speed, "following_error": _FOLLOWING_COUNTS / counts}
