"""Statuswords, controlwords and PDO mappings against published tables.

DS402  statusword patterns of CiA DS402-2 V3.0, as printed by Toshiba for VF-S15, 6.1.2
Elmo2  Elmo MAN-CAN402IG 1.2, page 27 (controlword)
S300   Kollmorgen S300-S700 CANopen, December 2019, pages 52 and 134
Bmx    Baumueller b maXX 1000 parameter manual 5.07004.03, B.3, page 182
"""

import itertools

import pytest
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import State
from tautscope.hardware.object_dictionary import Entry

MAPPINGS = {
    objects.CONTROLWORD: 0x60400010,  # S300
    objects.TARGET_POSITION: 0x607A0020,  # S300
    objects.MODE_DISPLAY: 0x60610008,  # Bmx
}


@pytest.mark.parametrize("entry", MAPPINGS, ids=str)
def test_pdo_mapping_entry(entry: Entry) -> None:
    assert entry.mapping == MAPPINGS[entry]


PATTERNS = {  # DS402
    State.NOT_READY: "x0xx0000",
    State.SWITCH_ON_DISABLED: "x1xx0000",
    State.READY: "x01x0001",
    State.SWITCHED_ON: "x01x0011",
    State.OPERATION_ENABLED: "x01x0111",
    State.QUICK_STOP_ACTIVE: "x00x0111",
    State.FAULT: "x0xx1000",
    State.FAULT_REACTION: "x0xx1111",
}
COMMANDS = {  # Elmo2: bits 7, 3, 2, 1, 0; the other bits are not part of the command
    cia402.SHUTDOWN: "0xxxx110",
    cia402.SWITCH_ON: "0xxx0111",
    cia402.DISABLE_VOLTAGE: "0xxxxx0x",
    cia402.QUICK_STOP: "0xxxx01x",
    cia402.ENABLE_OPERATION: "0xxx1111",
    cia402.ENABLE_INTERPOLATION: "0xx11111",
    cia402.FAULT_RESET: "1xxxxxxx",
}


def words(pattern: str) -> list[int]:
    bits = [("0", "1") if bit == "x" else (bit,) for bit in pattern]
    return [int("".join(chosen), 2) for chosen in itertools.product(*bits)]


def test_every_statusword_of_the_standard() -> None:
    for high in (0x00, 0x02, 0x16, 0xFF):
        for state, pattern in PATTERNS.items():
            for word in words(pattern):
                assert cia402.state_of(high << 8 | word) is state, f"0x{high << 8 | word:04X}"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_controlword_of_the_standard(command: int) -> None:
    assert command in words(COMMANDS[command])


def test_error_codes_have_their_class_in_words() -> None:
    told = [cia402.error_text(code) for code in (0x4310, 0x2310, 0x8611, 0x8250, 0x0001)]
    assert told[:2] == ["0x4310 (temperature)", "0x2310 (current)"]
    assert told[2:] == ["0x8611 (following error or positioning)", "0x8250 (monitoring)", "0x0001"]
