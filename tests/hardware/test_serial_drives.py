"""Motors behind a microcontroller: units, limits; faults end in a named error and a stop."""

import os
import re
import termios
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serial
from common.paths import ROOT
from paced_motion import drive, follow_in_si_units, running_line
from serial_settings import AXES, serial_config, serial_document
from tautscope.bench.microcontroller import SimulatedMicrocontroller
from tautscope.cli import main
from tautscope.config import dump_config, from_document
from tautscope.dof import Dof
from tautscope.errors import (
    BusError,
    ConfigError,
    DriveError,
    EmergencyError,
    FieldError,
    FollowingError,
    ModeRefusedError,
    SecondMasterError,
    SettingRefusedError,
    SignalError,
    SilentDriveError,
    StateError,
)
from tautscope.hardware.doctor.drives import check_drives
from tautscope.hardware.drive_group import Feedback
from tautscope.hardware.drives import Drives, open_drives
from tautscope.hardware.jog import jog
from tautscope.hardware.serial_line import frames
from tautscope.hardware.serial_line.frames import Refusal, Request, State
from tautscope.hardware.serial_line.line import open_port
from tautscope.hardware.serial_line.serial_drives import SerialDrives
from test_processes import MASTER, process
from waiting import TIMEOUT, until

START = np.array([0.0, 1.5, 0.5])
"""Where the motors are at the start: at 0 counts."""
running = partial(running_line, SimulatedMicrocontroller, START)


def is_at_rest(motors: SimulatedMicrocontroller) -> bool:
    """Whether no motor has a target elsewhere; counts are rounded twice."""
    pairs = zip(motors.board.targets, motors.board.positions, strict=True)
    return all(abs(target - position) <= 1 for target, position in pairs)


def test_a_channel_can_be_used_after_a_file_in_its_place_is_gone(tmp_path: Path) -> None:
    config = serial_config(tmp_path)
    channel = Path(config.channel)
    channel.write_text("")
    board = SimulatedMicrocontroller(config)
    with pytest.raises(ConfigError, match="a link that can be made"), board:
        pass
    channel.unlink()
    with SimulatedMicrocontroller(config):
        assert channel.is_symlink()


def test_motors_follow_in_si_units(tmp_path: Path) -> None:
    follow_in_si_units(SimulatedMicrocontroller, serial_config(tmp_path), START)


def test_each_of_set_points_that_are_read_together_moves_the_motors(tmp_path: Path) -> None:
    demands: list[float] = []

    def plant(demand: np.ndarray) -> np.ndarray:
        demands.append(demand[Dof.ROTATION])
        return demand

    motors = SimulatedMicrocontroller(serial_config(tmp_path), plant, start=START)
    motors.board.state, motors.board.watchdog = State.ENABLED, 1000
    targets = range(760, 950, 10)  # counts of axis 1, which is at 750
    for number, target in enumerate(targets):
        motors._buffer += frames.request(
            Request.SETPOINTS, number, frames.setpoints([target, 0, 0])
        )
    motors._process(0.0)
    answers = bytearray().join(answer for _, _, answer in sorted(motors._queued))
    found = [frames.read_status(each, 3).positions[0] for each in frames.take_messages(answers)]  # type: ignore[union-attr]
    assert found == [750, *targets[:-1]]
    count = 1 / motors._config.rotation.counts_per_unit
    assert demands == pytest.approx([at * count for at in targets[:-1]])


@pytest.mark.parametrize(
    ("kind", "error", "node", "message"),
    [
        ("drop", SilentDriveError, "insertion, axis 3", "no answer to"),
        ("delay", SilentDriveError, "insertion, axis 3", "no answer to"),
        ("fault", EmergencyError, "rotation, axis 1", r"it reports a fault: driver \(1\)"),
        ("freeze", FollowingError, "rotation, axis 1", "blocks the motor"),
        ("restart", StateError, "microcontroller on", "it is disabled. If it restarted"),
    ],
)
def test_fault_while_running_stops_all_motors(
    tmp_path: Path, kind: str, error: type[DriveError], node: str, message: str
) -> None:
    config = serial_config(tmp_path, state_timeout=1.0)
    with running(config) as (board, drives):
        drive(drives, 5)
        board.inject(kind, Dof.ROTATION, 60.0)
        with pytest.raises(error, match=message) as found:
            drive(drives, 10_000)
        assert found.value.node.startswith(node)
        assert not drives.is_running
        if kind in ("drop", "delay"):
            assert "rotation, axis 1" in str(found.value.__notes__)
        until(lambda: board.board.state != State.ENABLED and is_at_rest(board))


def test_lost_answers_are_counted_and_the_motion_goes_on(tmp_path: Path) -> None:
    with running(serial_config(tmp_path)) as (board, drives):
        board.inject("drop", Dof.INSERTION)
        late = drives.statistics.late
        until(lambda: drives.exchange(drives.last_command) is not None and min(late) > 3)
        board.clear(Dof.INSERTION)
        drive(drives, 10)
        before = late[0]
        board.inject("delay", Dof.INSERTION, 1.5 * drives.cycle)  # answers to earlier set-points
        for _ in range(20):
            drives.exchange(drives.last_command)
        assert late[0] >= before + 20
        assert 3 < max(drives.statistics.lost) <= min(late)  # an answer is that of all motors


def test_killed_host_is_stopped_by_the_watchdog(tmp_path: Path) -> None:
    config = from_document({"drives": serial_document(tmp_path)})
    file = tmp_path / "rig.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    assert config.drives is not None
    with SimulatedMicrocontroller(config.drives, start=START) as board:
        with process(MASTER, str(file), "signal") as (master, output):
            output._queue.get(timeout=TIMEOUT)  # it moves
            with pytest.raises(SecondMasterError):
                open_drives(config.drives)
            (finding,) = check_drives(config.drives)
            assert "another program commands these drives" in finding.found
            master.kill()
            master.wait(TIMEOUT)
        until(lambda: board.board.state == State.SILENCE)
        assert is_at_rest(board)


def test_the_code_of_the_page_keeps_the_pace(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = (ROOT / "docs" / "hardware.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    config, requests = serial_config(tmp_path), list[float]()
    document = {"drives": serial_document(tmp_path)}
    (tmp_path / "rig.toml").write_text(dump_config(from_document(document)), encoding="utf-8")
    exchange = SerialDrives.exchange

    def note(drives: SerialDrives, targets: list[int]) -> list[Feedback]:
        requests.append(time.monotonic())
        return exchange(drives, targets)

    monkeypatch.setattr(SerialDrives, "exchange", note)
    monkeypatch.chdir(tmp_path)
    with SimulatedMicrocontroller(config, start=START):
        exec(code, {})
    assert len(requests) > 10
    # The first is of the start.
    assert requests[-1] - requests[0] >= (len(requests) - 2) * config.cycle - 1e-6


def test_a_pause_before_the_start_is_none_of_the_computer(tmp_path: Path) -> None:
    with running(serial_config(tmp_path, heartbeat_timeout=0.2)) as (board, drives):
        drives.exchange(drives.last_command)
        drives.stop()
        time.sleep(0.4)
        board.inject("fault", Dof.BENDING)
        until(lambda: any(board.board.faults))
        with pytest.raises(StateError, match="driver") as found:
            drives.start()
    assert not hasattr(found.value, "__notes__")


def test_a_command_beyond_a_limit_is_shown_as_a_number(tmp_path: Path) -> None:
    with running(serial_config(tmp_path)) as (_, drives), pytest.raises(SignalError) as found:
        drives.exchange(drives.last_command + np.array([1.0, 0.0, 0.0]))
    assert str(found.value).startswith("command[insertion]: got 1.0, expected -0.05 to 0.08")


def test_a_jog_beyond_the_travel_is_refused_where_the_motor_is(tmp_path: Path) -> None:
    demands: list[np.ndarray] = []

    def plant(demand: np.ndarray) -> np.ndarray:
        demands.append(demand)
        return demand

    at = np.array([0.0792, 1.5, 0.5])
    config = serial_config(tmp_path)
    told = pytest.raises(FieldError, match=r"distance: got 0.002, .* is at 0\.0792 m")
    with SimulatedMicrocontroller(config, plant, start=at), told:
        jog(config, Dof.INSERTION, 2e-3)
    np.testing.assert_array_equal(demands, [demands[0]] * len(demands))


def test_host_that_hangs_is_stopped_by_the_watchdog(tmp_path: Path) -> None:
    with running(serial_config(tmp_path, heartbeat_timeout=1.0)) as (board, drives):
        drive(drives, 3)
        until(lambda: board.board.state == State.SILENCE)
        with pytest.raises(StateError, match=r"no set-point for .*heartbeat_timeout"):
            drive(drives, 1)
        assert board.board.state == State.STOPPED


def test_motors_that_a_killed_host_left_enabled_are_stopped_before_they_are_enabled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config, asked = serial_config(tmp_path, heartbeat_timeout=5.0), list[Request]()
    ask = SerialDrives._ask

    def record(drives: SerialDrives, kind: Request, *rest: Any, **named: Any) -> frames.Status:
        asked.append(kind)
        return ask(drives, kind, *rest, **named)

    monkeypatch.setattr(SerialDrives, "_ask", record)
    with SimulatedMicrocontroller(config, start=START) as board:
        killed = SerialDrives(config, open_port(config))
        killed.enable(reset_faults=False)
        killed.close()  # without a stop
        assert board.board.state == State.ENABLED
        asked.clear()
        with open_drives(config) as drives:
            drives.start()
            assert asked[-3:] == [Request.READ, Request.STOP, Request.ENABLE]


def test_a_refused_enable_is_told_in_words(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "tautscope.bench.serial_board.SerialBoard._enable", lambda *_: Refusal.STATE
    )
    config = serial_config(tmp_path)
    told = pytest.raises(StateError, match="stays disabled, and refuses with reason 3, state")
    with SimulatedMicrocontroller(config, start=START), open_drives(config) as drives, told:
        drives.start()


def test_unplugged_port_is_a_bus_error(tmp_path: Path) -> None:
    with running(serial_config(tmp_path, state_timeout=0.2)) as (board, drives):
        drive(drives, 3)
        board.inject("unplug", Dof.BENDING)
        with pytest.raises(BusError, match="connection is lost") as found:
            drive(drives, 10_000)
        assert "quick stop is not confirmed" in str(found.value.__notes__)


def test_an_adapter_can_be_unplugged_twice_and_plugged_in_again(tmp_path: Path) -> None:
    config = serial_config(tmp_path)
    with SimulatedMicrocontroller(config, start=START) as board:
        for dof in (Dof.BENDING, Dof.BENDING, Dof.ROTATION):
            board.inject("unplug", dof)
        board.clear(Dof.BENDING)
        until(lambda: not (board._requests or board._faults[Dof.BENDING]))
        assert not Path(config.channel).exists()  # rotation's is still unplugged
        board.clear(Dof.ROTATION)
        until(Path(config.channel).exists)
        with open_drives(config) as drives:
            np.testing.assert_allclose(drives.start(), START, atol=2e-3)


def test_stopped_released_and_disabled(tmp_path: Path) -> None:
    for changes, end, state in (
        ({}, Drives.stop, State.STOPPED),
        ({"after_quick_stop": "release"}, Drives.stop, State.DISABLED),
        ({}, Drives.disable, State.DISABLED),
    ):
        with running(serial_config(tmp_path, **changes)) as (
            board,
            drives,
        ):
            drive(drives, 3)
            end(drives)
            assert board.board.state == state
            assert is_at_rest(board)


def test_fault_persists_until_it_is_reset(tmp_path: Path) -> None:
    config = serial_config(tmp_path)
    with running(config) as (board, drives):
        board.inject("fault", Dof.BENDING)
        with pytest.raises(EmergencyError, match="bending, axis 2"):
            drive(drives, 10_000)
        drives.close()
        with open_drives(config) as again, pytest.raises(StateError, match=r"bending.*driver"):
            again.start()
        board.clear(Dof.BENDING)
        with open_drives(config) as again, pytest.raises(StateError, match="a fault has stopped"):
            again.start()
        with open_drives(config) as again:
            again.start(reset_faults=True)
        board.inject("fault", Dof.BENDING)
        until(lambda: any(board.board.faults))
        with open_drives(config) as again, pytest.raises(StateError, match=r"bending.*driver"):
            again.start(reset_faults=True)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"node": 4}, SettingRefusedError, "has 3 axes. Correct drives.rotation.node"),
        (
            {"counts_per_unit": 1.7e7, "travel": [-120.0, 0.0], "speed_limit": 1e-3},
            SettingRefusedError,
            "takes -1073741824 to 1073741824",
        ),
        ({"speed_limit": 40.0}, SettingRefusedError, "20000 counts/s, .* reaches 10000"),
    ],
)
def test_wrong_configuration_is_named_before_anything_moves(
    tmp_path: Path, changes: dict[str, Any], error: type[DriveError], message: str
) -> None:
    config = serial_config(tmp_path, rotation=AXES["rotation"] | changes)
    with SimulatedMicrocontroller(serial_config(tmp_path), start=START) as board:
        with pytest.raises(error, match=message):
            open_drives(config)
        missing = [one.what for one in check_drives(config) if one.status == "missing"]
        assert len(missing) == 1
        assert "rotation" in missing[0]
        assert not board.events


@pytest.mark.parametrize(
    ("changes", "field", "message"),
    [
        ({"rotation": AXES["rotation"] | {"node": 9}}, "drives.rotation.node", "1 to 8"),
        ({"rotation": AXES["rotation"] | {"model": "X"}}, "drives.rotation.model", "servos"),
        ({"rotation": AXES["rotation"] | {"eds": "x"}}, "drives.rotation.eds", "CiA 402"),
        ({"lead_points": 3}, "drives.lead_points", "CiA 402"),
        ({"rotation": {"node": 1}}, "drives.rotation.counts_per_unit", "no default"),
    ],
)
def test_error_names_the_invalid_key(
    tmp_path: Path, changes: dict[str, Any], field: str, message: str
) -> None:
    with pytest.raises(ConfigError) as found:
        serial_config(tmp_path, **changes)
    assert found.value.field == field
    assert message in found.value.allowed


def test_defaults_are_in_units_of_the_dof(tmp_path: Path) -> None:
    document = serial_document(tmp_path)
    del document["channel"]
    drives = from_document({"drives": document}).drives
    assert drives is not None
    assert (drives.channel, drives.bitrate, drives.lag) == ("/dev/ttyACM0", 250_000, 0.06)
    assert drives.insertion.following_error == pytest.approx(0.01 * 0.13)
    assert drives.bending.following_window == pytest.approx(0.005 * 6.0)
    assert (drives.insertion.sign, drives.bending.sign) == (1, -1)


def test_port_that_is_missing_or_silent(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = serial_config(tmp_path)
    with pytest.raises(BusError, match=r"cannot be opened.*drives\.channel"):
        open_drives(config)
    monkeypatch.setattr("tautscope.hardware.serial_line.serial_drives._START", 0.3)
    with SimulatedMicrocontroller(config, start=START) as board:
        board.inject("drop", Dof.INSERTION)
        with pytest.raises(SilentDriveError, match=r"no answer for 0.3 s.*drives\.bitrate"):
            open_drives(config)
    monkeypatch.setattr("tautscope.hardware.serial_line.frames.hello_answer", version_9)
    with SimulatedMicrocontroller(config), pytest.raises(ModeRefusedError, match="version 9"):
        open_drives(config)


def version_9(number: int, hello: object) -> bytes:
    return frames.encode(bytes([0x81, number & 0xFF, number >> 8, 9, 0, 1, 2, 3]))


def test_doctor_finds_all_there_and_stops_are_not_searched(tmp_path: Path) -> None:
    document = {"drives": serial_document(tmp_path)}
    config = serial_config(tmp_path)
    with SimulatedMicrocontroller(config, start=START) as board:
        findings = check_drives(config)
        assert not board.events
    assert [one.what for one in findings if one.status == "missing"] == []
    assert "disabled; no fault; " in "; ".join(one.found for one in findings)
    file = tmp_path / "rig.toml"
    file.write_text(dump_config(from_document(document)), encoding="utf-8")
    assert main(["calibrate", "stops", "insertion", "--config", str(file), "--yes"]) == 2


def test_an_arduino_goes_on_when_its_port_is_closed(tmp_path: Path) -> None:
    """It restarts where DTR is switched off and on, which HUPCL does."""
    _, end = os.openpty()
    attributes = termios.tcgetattr(end)
    attributes[2] |= termios.HUPCL
    termios.tcsetattr(end, termios.TCSANOW, attributes)
    open_port(serial_config(tmp_path, channel=os.ttyname(end))).close()
    assert not termios.tcgetattr(end)[2] & termios.HUPCL


def test_a_client_of_the_page_alone(tmp_path: Path) -> None:
    """The bytes of docs/serial.md's example by pyserial: no code of this package."""
    with (
        SimulatedMicrocontroller(serial_config(tmp_path), start=START) as board,
        serial.Serial(str(tmp_path / "board"), 250_000, timeout=TIMEOUT) as port,
    ):
        port.write(bytes.fromhex("03 04 07 02 64 01 01 05 ce ff ff ff 01 01 01 03 62 25 00"))
        answer = port.read_until(b"\0")
        assert answer[:6] == bytes.fromhex("03 84 07 01 02 03")  # refused: not enabled
        port.write(frames.encode(bytes.fromhex("03 01 00 e8 03")))  # for 1000 ms
        assert port.read_until(b"\0")[:5] == bytes.fromhex("03 83 01 02 01")
        port.write(bytes.fromhex("03 04 07 02 64 01 01 05 ce ff ff ff 01 01 01 03 62 25 00"))
        assert port.read_until(b"\0")[:5] == bytes.fromhex("03 84 07 02 01")
        until(lambda: board.board.positions == [100, -50, 0])
