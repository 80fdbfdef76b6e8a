"""CANopen frames against examples that standards and manufacturers published.

Frames are written as candump writes them. Sources:

EPOS   trace of an EPOS drive, node 2: github.com/machinekit/machinekit/issues/589 (2015-07-06)
Festo  GDCP-CMMS/D-C-CO-EN 1404NH, section 3, "CANopen access procedure", page 20
Bmx    Baumueller b maXX 1000 parameter manual 5.07004.03, B.3, page 182
EAO    EAO series 09 CANopen manual, page 51, after the CAN poster of CiA
S300   Kollmorgen S300-S700 CANopen, December 2019, pages 52 and 134; Beckhoff AX2000, page 128
Elmo1  Elmo MAN-CAN301IG 2.1, pages 4-6 and 4-9
Elmo2  Elmo MAN-CAN402IG 1.2, pages 27 (controlword) and 86 (0x60C2)
Vect   Bonfiglioli Active, CANopen, 8.1.9 (0x1016)
"""

import pytest
from bus_transcript import frame, open_transcript
from drive_settings import drives_config
from tautscope.bench.canopen_node import CanopenNode
from tautscope.bench.drive import SimulatedDrive
from tautscope.dof import Dof
from tautscope.errors import DriveError, EmergencyError, SecondMasterError, SettingRefusedError
from tautscope.hardware import cia402
from tautscope.hardware import object_dictionary as objects
from tautscope.hardware.cia402 import Mode, State
from tautscope.hardware.fieldbus import AbsentError
from tautscope.hardware.object_dictionary import Entry


@pytest.mark.parametrize(
    ("node", "asked", "answered", "entry", "value"),
    [
        (2, "602#4041600000000000", "582#4B41600037070000", objects.STATUSWORD, 0x0737),  # EPOS
        (
            1,
            "601#4061600000000000",
            "581#4F61600001000000",
            objects.MODE_DISPLAY,
            1,
        ),  # Festo
        (1, "601#4041600000000000", "581#4B41600034120000", objects.STATUSWORD, 0x1234),  # Festo
        (
            1,
            "601#4093600100000000",
            "581#4393600178563412",
            Entry(0x6093, 1, "position factor", 4),
            0x12345678,
        ),  # Festo
    ],
)
def test_sdo_upload(node: int, asked: str, answered: str, entry: Entry, value: int) -> None:
    with open_transcript({asked: answered}, node) as (fieldbus, bus):
        assert fieldbus.read(Dof.INSERTION, entry) == value
        assert bus.sent == [asked]


@pytest.mark.parametrize(
    ("node", "sent", "answered", "entry", "value"),
    [
        (1, "601#2F011402EF000000", "581#6001140200000000", (0x1401, 2, 1), 0xEF),  # Festo
        (1, "601#2B406000E8030000", "581#6040600000000000", (0x6040, 0, 2), 0x03E8),  # Festo
        (1, "601#2393600178563412", "581#6093600100000000", (0x6093, 1, 4), 0x12345678),  # Festo
        (4, "604#2300180208006160", "584#6000180200000000", (0x1800, 9, 4), 0x60610008),  # Bmx
    ],
)
def test_sdo_download(
    node: int, sent: str, answered: str, entry: tuple[int, int, int], value: int
) -> None:
    index, subindex, size = entry
    if (index, subindex) == (0x1800, 9):
        subindex = 2  # the manual writes four bytes, against the type of CiA 301
    with open_transcript({sent: answered}, node) as (fieldbus, bus):
        fieldbus._described[Dof.INSERTION].types.pop((index, subindex), None)
        fieldbus.write(Dof.INSERTION, Entry(index, subindex, "object", size), value)  # type: ignore[arg-type]
        assert bus.sent == [sent]


def test_a_late_answer_does_not_close_the_channel() -> None:
    """The answer to a request that was given up arrives before the next request."""
    asked, answered = "601#4041600000000000", "581#4B41600037020000"
    with open_transcript({asked: answered}) as (fieldbus, bus):
        for _ in range(3):
            bus.waiting.append("581#4B41600040020000")
            fieldbus.receive_pending()
            assert fieldbus.read(Dof.INSERTION, Entry(0x6041, 0, "statusword", 2)) == 0x237


@pytest.mark.parametrize(
    ("code", "error"),
    [
        ("30000906", SettingRefusedError),  # 0609 0030h value range of parameter exceeded
        ("31000906", SettingRefusedError),  # 0609 0031h value of parameter written too high
        ("00000206", AbsentError),  # 0602 0000h object does not exist
        ("11000906", AbsentError),  # 0609 0011h sub-index does not exist
    ],
)
def test_sdo_abort_codes(code: str, error: type[DriveError]) -> None:
    """Elmo1: 0x80, index, sub-index, abort code as Unsigned32."""
    with open_transcript({"601#2F60600007000000": f"581#80606000{code}"}) as (fieldbus, _):
        number = int.from_bytes(bytes.fromhex(code), "little")
        with pytest.raises(error) as found:
            fieldbus.write(Dof.INSERTION, objects.MODES_OF_OPERATION, 7)
        assert type(found.value) is error
        assert "insertion, node 1" in str(found.value)
        if error is SettingRefusedError:
            assert f"0x{number:08X}" in str(found.value)


def test_enabling_follows_a_recorded_trace() -> None:
    """EPOS: 40 07, 06 00, 21 07, 07 00, 23 07, 0F 00, 37 07 on 182 and 202."""
    trace = [(0x0740, "0600"), (0x0721, "0700"), (0x0723, "0F00")]
    for statusword, controlword in trace:
        word = cia402.next_controlword(cia402.state_of(statusword))
        assert word is not None
        with open_transcript({}, node=2) as (fieldbus, bus):
            fieldbus.exchange([word] * 3, [0] * 3)
        assert f"202#{controlword}" in bus.sent
        assert bus.sent[-1] == "080#"  # S300: SYNC
    assert cia402.state_of(0x0737) is State.OPERATION_ENABLED


def test_quick_stop_and_disable_voltage_controlwords() -> None:
    """Elmo2: bits 2, 1 of the controlword are 0, 1 for quick stop; bit 1 is 0 for disable voltage.

    They are repeated, also after the emergency object of S300.
    """
    with open_transcript({}) as (fieldbus, bus):
        bus.waiting.append("081#1043080100000000")
        for word, data in ((cia402.QUICK_STOP, "0200"), (cia402.DISABLE_VOLTAGE, "0000")):
            for _ in range(2):
                bus.sent.clear()
                fieldbus.broadcast(word, [0] * 3)
                assert [f"20{node}#{data}" for node in (1, 2, 3)] == [
                    one for one in bus.sent if one.startswith("20")
                ]
                assert bus.sent[-1] == "080#"


def test_interpolated_position_frames() -> None:
    """Elmo2: 0x60C2:1 in milliseconds; bit 4 of the controlword enables interpolation."""
    with open_transcript({"601#2FC260010A000000": "581#60C2600100000000"}) as (fieldbus, bus):
        fieldbus.write(Dof.INSERTION, objects.INTERPOLATION_TIME, 10)
        fieldbus.exchange([cia402.ENABLE_INTERPOLATION] * 3, [0x12345678, -2, 0])
        assert "201#1F00" in bus.sent
        assert "301#78563412" in bus.sent
        assert "302#FEFFFFFF" in bus.sent


def test_network_management_and_heartbeat() -> None:
    """EAO: 70b#00, 70b#7F, 000#010b, 70b#05."""
    with open_transcript({}, node=0x0B) as (fieldbus, bus):
        fieldbus.start()
        assert "000#010B" in bus.sent
        bus.waiting += ["70B#7F", "70B#05"]
        fieldbus.exchange([0] * 3, [0] * 3)
        assert "77F#05" in bus.sent  # the master's node id is 0x7F

    sent: list[str] = []
    node = CanopenNode(0x0B, lambda identifier, data: sent.append(frame(identifier, data)))
    node.boot(0.0)
    node.receive(0x60B, bytes.fromhex("2B1710000A000000"), 0.0)
    node.tick(0.0)
    node.receive(0x000, bytes.fromhex("010B"), 0.0)
    node.tick(0.01)
    assert sent == ["70B#00", "58B#6017100000000000", "70B#7F", "70B#05"]


def test_consumer_heartbeat_encodes_node_and_time() -> None:
    """Vect: bits 23-16 node id, bits 15-0 time in ms."""
    written = "601#2316100150007F00"
    with open_transcript({written: "581#6016100100000000"}) as (fieldbus, bus):
        fieldbus.write(Dof.INSERTION, objects.CONSUMER_HEARTBEAT, 127 << 16 | 80)
        assert bus.sent == [written]


def test_a_bus_that_takes_no_frame_is_waited_for_within_the_cycle() -> None:
    with open_transcript({}) as (fieldbus, bus):
        waits: list[float | None] = []
        bus.send = lambda msg, timeout=None: waits.append(timeout)  # type: ignore[method-assign]
        fieldbus.send(0x080, b"")
        assert waits == [fieldbus._config.reply_timeout]


def test_emergency_object_raises() -> None:
    """S300: 081 10 43 08 01 is the motor temperature; 081 00 00 resets it."""
    with open_transcript({}) as (fieldbus, bus):
        bus.waiting.append("081#0000080000000000")
        fieldbus.exchange([0] * 3, [0] * 3)
        bus.waiting.append("081#1043080100000000")
        with pytest.raises(EmergencyError, match=r"insertion, node 1: emergency 0x4310.*0x08"):
            fieldbus.exchange([0] * 3, [0] * 3)


@pytest.mark.parametrize("foreign", ["080#", "202#0F00", "000#8100", "77F#05"])
def test_second_master_raises(foreign: str) -> None:
    with open_transcript({}) as (fieldbus, bus):
        bus.waiting.append(foreign)
        with pytest.raises(SecondMasterError, match=foreign):
            fieldbus.exchange([0] * 3, [0] * 3)


def test_simulated_drive_answers_as_published() -> None:
    """EPOS and Elmo1: statuswords and refusals of the simulated drive."""
    sent: list[str] = []
    drive = SimulatedDrive(
        Dof.ROTATION,
        drives_config(),
        lambda identifier, data: sent.append(frame(identifier, data)),
        lambda now, what: None,
        modes=frozenset({Mode.INTERPOLATED_POSITION}),
    )
    drive.boot(0.0)
    drive.receive(0x000, bytes.fromhex("0102"), 0.0)
    shown = []
    for controlword in ("0000", "0600", "0700", "0F00"):
        drive.receive(0x602, bytes.fromhex(f"2B406000{controlword}0000"), 0.0)
        sent.clear()
        drive.receive(0x602, bytes.fromhex("4041600000000000"), 0.0)
        assert sent[0].startswith("582#4B416000")
        shown.append(cia402.state_of(drive.values[0x6041, 0]))
    assert shown == [cia402.state_of(word) for word in (0x0740, 0x0721, 0x0723, 0x0737)]
    sent.clear()
    drive.receive(0x602, bytes.fromhex("2F60600008000000"), 0.0)
    assert sent == ["582#8060600030000906"]  # 0609 0030h
    sent.clear()
    drive.fail(0.0)
    assert sent[0].startswith("082#1043")
