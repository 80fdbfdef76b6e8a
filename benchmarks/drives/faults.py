"""What may happen to motors on a bus, and how it must end, by protocol."""

import os
import signal
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from drives.trial import Trial
from tautscope.bench.servo_packets import crc16
from tautscope.hardware.scale import Scale
from tautscope.hardware.serial_line import frames

PAUSE = 0.3
"""How long the controller is paused [s]."""
SERVOS = frozenset({"dynamixel", "feetech"})
ON_LINE = SERVOS | {"serial"}
ALL = ON_LINE | {"canopen"}
WITH_WATCHDOG = ALL - {"feetech"}
STOP_MARGIN = 0.1
"""Time beyond `heartbeat_timeout` in which a watchdog must stop a motor: its steps, a cycle, and
delays of a computer that simulates it [s]."""
UNKNOWN_ID = 8
FOREIGN = 100
"""Set-points of another program."""


def paused(trial: Trial) -> None:
    trial.signal(signal.SIGSTOP)
    time.sleep(PAUSE)
    trial.signal(signal.SIGCONT)


def foreign(trial: Trial) -> None:
    """Set-points of another program that had the port open before, every 5 ms."""
    goals = [Scale(trial.config[motor], "").to_counts(0.0) for motor in trial.labels]
    port = os.open(trial.config.channel, os.O_RDWR | os.O_NOCTTY)  # as root, also later
    for number in range(FOREIGN):
        os.write(port, setpoints(trial.config.protocol, goals, number))
        time.sleep(0.005)
    os.close(port)


def setpoints(protocol: str, goals: list[int], number: int) -> bytes:
    """A request for all motors, with ids from 1, from the makers' manuals and docs/serial.md."""
    if protocol == "serial":
        return b"\0" + frames.request(frames.Request.SETPOINTS, number, frames.setpoints(goals))
    if protocol == "feetech":
        data = b"".join(struct.pack("<BH", at, goal) for at, goal in enumerate(goals, 1))
        body = bytes([0xFE, len(data) + 4, 0x83, 42, 2]) + data
        return b"\xff\xff" + body + bytes([~sum(body) & 0xFF])
    data = b"".join(struct.pack("<Bi", at, goal) for at, goal in enumerate(goals, 1))
    body = b"\xff\xff\xfd\0\xfe" + struct.pack("<HBHH", len(data) + 7, 0x83, 116, 4) + data
    return body + struct.pack("<H", crc16(body))


@dataclass(frozen=True)
class Fault:
    """Something that happens.

    Attributes:
        what: In words.
        happens: Makes it happen; None if it is there from the start.
        errors: By protocol, the error that must end the controller, "" if none can; the protocols
            that do not have this are missing.
        names_motor: Whether the message must name the motor to which it happens.
        wrong_node: Whether the controller believes in another id of that motor.
        speaker: 0 if the controller must end, 1 if the other program must.
        is_silent: Whether only their watchdogs can stop the motors.
    """

    what: str
    happens: Callable[[Trial], None] | None
    errors: dict[str, str] = field(default_factory=dict)
    names_motor: bool = False
    wrong_node: bool = False
    speaker: int = 0
    is_silent: bool = False

    def is_right(self, trial: Trial, protocol: str) -> bool:
        """Whether it ended as it must."""
        said, other = trial.said[self.speaker], trial.said[0]
        if self.speaker and other:
            return False  # the controller goes on
        if self.is_silent and protocol in WITH_WATCHDOG:
            limit = trial.config.heartbeat_timeout + STOP_MARGIN
            if max(trial.stopped()) > limit:
                return False
        named = not self.names_motor or trial.one.label in said.get("message", "")
        return said.get("error", "") in self.errors[protocol].split("|") and named


FAULTS = (
    Fault(
        "controller killed",
        lambda t: t.signal(signal.SIGKILL),
        dict.fromkeys(ALL, ""),
        is_silent=True,
    ),
    Fault(
        "controller stopped for ever",
        lambda t: t.signal(signal.SIGSTOP),
        dict.fromkeys(ALL, ""),
        is_silent=True,
    ),
    Fault(
        f"controller paused for {PAUSE:g} s",
        paused,
        dict.fromkeys(ALL, "StateError|SilentDriveError|EmergencyError|HeartbeatError|BusError"),
    ),
    Fault("told to end (SIGTERM)", lambda t: t.signal(signal.SIGTERM), dict.fromkeys(ALL, "")),
    Fault("adapter unplugged", lambda t: t.inject("unplug"), dict.fromkeys(ON_LINE, "BusError")),
    Fault(
        "bus unplugged",
        lambda t: t.inject("drop", every=True),
        dict.fromkeys(ON_LINE, "SilentDriveError") | {"canopen": "HeartbeatError|SilentDriveError"},
    ),
    Fault(
        "a motor silent",
        lambda t: t.inject("drop"),
        dict.fromkeys(SERVOS, "SilentDriveError") | {"canopen": "HeartbeatError|SilentDriveError"},
        names_motor=True,
    ),
    Fault(
        "answers 0.3 s late",
        lambda t: t.inject("delay"),
        dict.fromkeys(ON_LINE, "SilentDriveError") | {"canopen": "HeartbeatError|SilentDriveError"},
    ),
    Fault(
        "a motor's fault (of servos overload)",
        lambda t: t.inject("fault"),
        dict.fromkeys(ALL, "EmergencyError"),
        names_motor=True,
    ),
    Fault(
        "a motor blocked",
        lambda t: t.inject("freeze"),
        dict.fromkeys(ALL, "FollowingError"),
        names_motor=True,
    ),
    Fault(
        "supply fails for a moment",
        lambda t: t.inject("restart", every=True),
        dict.fromkeys(SERVOS, "FollowingError") | {"serial": "StateError"},
    ),
    Fault(
        "heartbeat lost",
        lambda t: t.inject("heartbeat"),
        {"canopen": "HeartbeatError"},
        names_motor=True,
    ),
    Fault("mode left", lambda t: t.inject("refuse"), {"canopen": "StateError"}, names_motor=True),
    Fault(
        "wrong id",
        None,
        dict.fromkeys(ALL, "SilentDriveError") | {"serial": "SettingRefusedError"},
        names_motor=True,
        wrong_node=True,
    ),
    Fault(
        "a second tautscope",
        lambda t: t.second.send(False),
        dict.fromkeys(ALL, "SecondMasterError"),
        speaker=1,
    ),
    Fault(
        "another program opens the bus",
        lambda t: t.second.send(True),
        dict.fromkeys(ON_LINE, "BusError") | {"canopen": "SecondMasterError"},
        speaker=1,
    ),
    Fault(
        "another master holds the motors where they began",
        foreign,
        dict.fromkeys(ON_LINE, "FollowingError"),
    ),
)
