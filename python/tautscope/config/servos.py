"""Models of servos."""

from dataclasses import dataclass

COUNTS_PER_TURN = 4096
"""Resolution of every servo here [counts per turn of the horn]."""


@dataclass(frozen=True, slots=True)
class ServoModel:
    """A model of a servo.

    Its speed [1/min] is that without load at the recommended voltage, from its manual.
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


def models_of(protocol: str) -> tuple[str, ...]:
    """Names of the models with a protocol."""
    return tuple(name for name, model in MODELS.items() if model.protocol == protocol)
