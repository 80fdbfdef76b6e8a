"""CiA 402: drive states, statusword and controlword, modes of operation.

Source: CiA 402-2 (IEC 61800-7-201), as reproduced in Elmo MAN-CAN402IG 1.2.
"""

from enum import IntEnum, StrEnum


class Mode(IntEnum):
    """The modes of operation (0x6060) that follow a stream of positions."""

    INTERPOLATED_POSITION = 7
    CYCLIC_SYNCHRONOUS_POSITION = 8

    @property
    def supported_bit(self) -> int:
        """The mode's bit in supported drive modes, 0x6502."""
        return 1 << (self - 1)


class State(StrEnum):
    """State of a drive, coded in its statusword (0x6041)."""

    NOT_READY = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY = "ready to switch on"
    SWITCHED_ON = "switched on"
    OPERATION_ENABLED = "operation enabled"
    QUICK_STOP_ACTIVE = "quick stop active"
    FAULT_REACTION = "fault reaction active"
    FAULT = "fault"


_STATUS = (
    (0x4F, 0x00, State.NOT_READY),
    (0x4F, 0x40, State.SWITCH_ON_DISABLED),
    (0x6F, 0x21, State.READY),
    (0x6F, 0x23, State.SWITCHED_ON),
    (0x6F, 0x27, State.OPERATION_ENABLED),
    (0x6F, 0x07, State.QUICK_STOP_ACTIVE),
    (0x4F, 0x0F, State.FAULT_REACTION),
    (0x4F, 0x08, State.FAULT),
)

STOPPED_STATES = frozenset(State) - {State.OPERATION_ENABLED, State.FAULT_REACTION}
"""States in which a drive follows no set-points."""

POWER_OFF_STATES = frozenset({State.NOT_READY, State.SWITCH_ON_DISABLED, State.READY, State.FAULT})
"""States in which no voltage is applied to the motor."""

REMOTE = 1 << 9
"""Statusword: the drive obeys the controlword; many drives leave it 0 and obey nevertheless."""
FOLLOWS_COMMAND = 1 << 12
"""Statusword: drive follows the command value (mode 8), interpolation is active (mode 7)."""
FOLLOWING_ERROR_BIT = 1 << 13
"""Statusword, mode 8: following error."""

DISABLE_VOLTAGE = 0x00
QUICK_STOP = 0x02
SHUTDOWN = 0x06
SWITCH_ON = 0x07
ENABLE_OPERATION = 0x0F
ENABLE_INTERPOLATION = 0x1F
"""Enable operation with bit 4, enable interpolation (mode 7)."""
FAULT_RESET = 0x80

QUICK_STOP_HOLD = 6
"""0x605A: slow down on the quick stop ramp and stay in quick stop active."""
QUICK_STOP_RELEASE = 2
"""0x605A: slow down on the quick stop ramp, then go to switch on disabled."""
ABORT_CONNECTION_QUICK_STOP = 3
"""0x6007: quick stop when the connection is lost."""

_NEXT = {
    State.SWITCH_ON_DISABLED: SHUTDOWN,
    State.READY: SWITCH_ON,
    State.SWITCHED_ON: ENABLE_OPERATION,
    State.OPERATION_ENABLED: ENABLE_OPERATION,
    State.QUICK_STOP_ACTIVE: DISABLE_VOLTAGE,
}


def state_of(statusword: int) -> State | None:
    """Decode the state in a statusword; None for a pattern that CiA 402 does not define."""
    for mask, value, state in _STATUS:
        if statusword & mask == value:
            return state
    return None


def next_controlword(state: State | None) -> int | None:
    """The controlword for the next transition towards operation enabled.

    None in a fault, and while the drive makes a transition by itself.
    """
    return _NEXT.get(state) if state is not None else None


_ERRORS = {
    0x1: "generic error",
    0x2: "current",
    0x3: "voltage",
    0x4: "temperature",
    0x5: "hardware of the drive",
    0x6: "software of the drive",
    0x7: "additional modules, such as sensor or brake",
    0x8: "monitoring",
    0x81: "communication",
    0x84: "speed controller",
    0x85: "position controller",
    0x86: "following error or positioning",
    0x9: "external error",
    0xF: "additional functions of its maker",
}
"""Classes of error codes by their first digits, as in CiA 301 and CiA 402."""


def error_text(code: int) -> str:
    """An error code (0x603F, or of an emergency object) with its class."""
    meaning = _ERRORS.get(code >> 8) or _ERRORS.get(code >> 12)
    return f"0x{code:04X}" + (f" ({meaning})" if meaning else "")
