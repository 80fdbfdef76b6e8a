"""Servos behind `Drives`: units, turns, settings; faults end in a named error and a stop."""

import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from paced_motion import drive, follow_in_si_units, running_line
from servo_settings import AXES, MODELS, START, servos_config, servos_document
from tautscope.bench.servo import SimulatedServo
from tautscope.bench.servo_packets import BROADCAST, READ, SYNC_WRITE, Packet
from tautscope.bench.servos import SimulatedServos
from tautscope.config import dump_config, from_document
from tautscope.dof import Dof
from tautscope.errors import (
    BusError,
    DriveError,
    EmergencyError,
    FollowingError,
    ModeRefusedError,
    SettingRefusedError,
    SilentDriveError,
    StateError,
)
from tautscope.hardware.doctor.drives import check_drives
from tautscope.hardware.drives import Drives, open_drives
from tautscope.hardware.servos.families import Register
from tautscope.hardware.servos.line import NoAnswerError, ServoLine
from tautscope.hardware.servos.servo import Servo
from tautscope.hardware.servos.servo_drives import ServoDrives
from test_processes import MASTER, process
from waiting import TIMEOUT, until

FAMILIES = pytest.mark.parametrize("protocol", ["dynamixel", "feetech"])
running = partial(running_line, SimulatedServos, START)


def goals_are_positions(servos: SimulatedServos) -> bool:
    """Whether no servo is on its way; a count is the resolution."""
    positions = [one.get(one.family.position) for one in servos.servos]
    goals = [one.get(one.family.goal) for one in servos.servos]
    torques = [one.get(one.family.torque) for one in servos.servos]
    return all(
        abs(goal - position) <= 1 or not torque
        for goal, position, torque in zip(goals, positions, torques, strict=True)
    )


@FAMILIES
def test_motors_follow_in_si_units_over_several_turns(protocol: str, tmp_path: Path) -> None:
    servos = follow_in_si_units(SimulatedServos, servos_config(protocol, tmp_path), START)
    until(lambda: goals_are_positions(servos))
    assert [one.what for one in servos.events] == ["torque on"] * 3  # and held


@FAMILIES
def test_of_packets_that_are_read_together_each_moves_the_servos_and_the_last_is_answered(
    protocol: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    demands: list[float] = []

    def plant(demand: np.ndarray) -> np.ndarray:
        demands.append(demand[Dof.INSERTION])
        return demand

    config = servos_config(protocol, tmp_path)
    motors = SimulatedServos(config, plant, start=START)
    servo, word = motors.servos[Dof.INSERTION], 2 if protocol == "dynamixel" else 1
    servo.write(servo.family.torque.address, b"\1", 0.0)
    goal, position = servo.family.goal, servo.family.position
    goals = [servo.get(goal) + step for step in range(2, 20, 2)]  # counts
    read = [*position.address.to_bytes(word, "little"), *position.size.to_bytes(word, "little")]
    together = []
    for each in goals:
        place = goal.address.to_bytes(word, "little") + goal.size.to_bytes(word, "little")
        data = place + bytes([servo.id]) + goal.encode(each)
        together += [Packet(BROADCAST, SYNC_WRITE, data, True, 20)]
        together += [Packet(servo.id, READ, bytes(read), True, 20)]
    monkeypatch.setattr(motors._codec, "split", lambda buffer: together)
    motors._process(0.0)
    count = 1 / config.insertion.counts_per_unit
    moved = [START[Dof.INSERTION] + step * count for step in range(2, 18, 2)]
    assert demands == pytest.approx(moved, abs=count / 2)
    ((_, _, answer),) = motors._queued
    assert position.encode(goals[-2]) in answer


@FAMILIES
def test_settings_are_read_back_and_stored_only_if_they_differ(
    protocol: str, tmp_path: Path
) -> None:
    axes = {"rotation": AXES["rotation"] | {"model": MODELS[protocol], "homing_offset": -40}}
    config = servos_config(protocol, tmp_path, **axes)
    with SimulatedServos(config, start=START) as servos:
        written: list[int] = []
        for servo in servos.servos:
            write = servo.write
            servo.write = lambda at, data, now, write=write: (
                written.append(at)
                or write(  # type: ignore[method-assign]
                    at, data, now
                )
            )
        for _ in range(2):
            with open_drives(config) as drives:
                (first, *_) = drives.commissioned
                assert (first.name, first.product) == (
                    "insertion, servo 1",
                    servos.servos[0].model.number,
                )
            stored, written[:] = list(written), []
        assert stored == []
        assert drives.commissioned[1].settings[
            "Homing Offset (20)" if protocol == "dynamixel" else "Offset (31)"
        ] == (-40 if protocol == "dynamixel" else 40)
        with open_drives(config) as drives:
            shift = -40 / config.rotation.counts_per_unit  # the servo adds it
            start = drives.start()
            assert start[Dof.ROTATION] == pytest.approx(START[Dof.ROTATION] + shift, abs=1e-3)


@FAMILIES
@pytest.mark.parametrize(
    ("kind", "error", "message"),
    [
        ("drop", SilentDriveError, "no answer to"),
        ("delay", SilentDriveError, "no answer to"),
        ("fault", EmergencyError, r"it reports a fault: overload \(0x20\)"),
        ("freeze", FollowingError, "blocks the motor"),
        ("restart", FollowingError, "following error|jumped"),
    ],
)
def test_fault_while_running_stops_all_motors(
    protocol: str, tmp_path: Path, kind: str, error: type[DriveError], message: str
) -> None:
    with running(servos_config(protocol, tmp_path)) as (
        servos,
        drives,
    ):
        drive(drives, 5)
        servos.inject(kind, Dof.ROTATION, 60.0)
        with pytest.raises(error, match=message) as found:
            drive(drives, 10_000)
        assert "rotation, servo 2" in str(found.value)
        assert not drives.is_running
        if kind in ("drop", "delay"):
            assert "rotation, servo 2: quick stop is not confirmed" in str(found.value.__notes__)
        servos.clear(Dof.ROTATION)
        until(lambda: goals_are_positions(servos))
        with pytest.raises(StateError, match="before start\\(\\) or after stop"):
            drives.exchange([0, 0, 0])


@FAMILIES
def test_killed_host(protocol: str, tmp_path: Path) -> None:
    """A Dynamixel stops by its bus watchdog, a Feetech at its last set-point; both hold."""
    config = from_document({"drives": servos_document(protocol, tmp_path)})
    file = tmp_path / "rig.toml"
    file.write_text(dump_config(config), encoding="utf-8")
    assert config.drives is not None
    with SimulatedServos(config.drives, start=START) as servos:
        with process(MASTER, str(file), "signal") as (master, output):
            output._queue.get(timeout=TIMEOUT)  # it moves
            master.kill()
            master.wait(TIMEOUT)
        if protocol == "dynamixel":
            until(lambda: sum(one.what == "bus watchdog" for one in servos.events) == 3)
        until(lambda: goals_are_positions(servos))
        assert all(one.get(one.family.torque) for one in servos.servos)


@FAMILIES
def test_unplugged_port_is_a_bus_error(protocol: str, tmp_path: Path) -> None:
    with running(servos_config(protocol, tmp_path, state_timeout=0.2)) as (servos, drives):
        drive(drives, 3)
        servos.inject("unplug", Dof.BENDING)
        with pytest.raises(BusError, match="connection is lost") as found:
            drive(drives, 10_000)
        assert "quick stop is not confirmed" in str(found.value.__notes__)


def test_dynamixel_stops_when_the_host_hangs_and_a_feetech_goes_to_its_last_goal(
    tmp_path: Path,
) -> None:
    for protocol, events in (("dynamixel", ["bus watchdog"] * 3), ("feetech", [])):
        folder = tmp_path / protocol
        folder.mkdir()
        config = servos_config(protocol, folder, heartbeat_timeout=0.2)
        with running(config) as (servos, drives):
            drive(drives, 3)
            before = len(servos.events)
            time.sleep(2 * config.heartbeat_timeout)
            with pytest.raises(StateError, match=r"no set-point for .*heartbeat_timeout"):
                drive(drives, 1)
            assert [one.what for one in servos.events[before:]] == events
            until(lambda servos=servos: goals_are_positions(servos))
        # The watchdog is off: the motors are held.
        assert all(one.get(one.family.torque) for one in servos.servos)


def test_a_pause_of_the_computer_while_it_waits_for_answers_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = servos_config("feetech", tmp_path, heartbeat_timeout=0.2)

    def paused(*arguments: Any) -> None:
        time.sleep(2 * config.heartbeat_timeout)
        raise NoAnswerError("timeout")

    with running(config) as (_, drives):
        drive(drives, 3)
        monkeypatch.setattr(ServoLine, "read_all", paused)
        with pytest.raises(SilentDriveError) as found:
            drive(drives, 1)
    assert "This computer paused for" in str(found.value.__notes__)


@FAMILIES
def test_released_and_disabled_motors_have_no_torque(protocol: str, tmp_path: Path) -> None:
    """It is switched off when they rest, and not on their way back to the last position read."""
    for changes, release in (({"after_quick_stop": "release"}, Drives.stop), ({}, Drives.disable)):
        with running(servos_config(protocol, tmp_path, **changes)) as (
            servos,
            drives,
        ):
            drive(drives, 3)
            servo, goal = servos.servos[Dof.ROTATION], servos.servos[Dof.ROTATION].family.goal
            servo.set(goal, servo.get(goal) + 20_000)
            time.sleep(0.1)
            release(drives)
            assert not any(one.get(one.family.torque) for one in servos.servos)
            assert abs(servo.get(servo.family.position) - servo.get(goal)) <= 1


def test_a_stop_that_was_not_confirmed_is_repeated(tmp_path: Path) -> None:
    with running(servos_config("feetech", tmp_path, state_timeout=0.3)) as (servos, drives):
        servo, goal = servos.servos[Dof.ROTATION], servos.servos[Dof.ROTATION].family.goal
        far = servo.get(goal) + 20_000
        servo.set(goal, far)  # it is on its way
        servos.inject("drop", Dof.ROTATION)
        for _ in range(2):
            with pytest.raises(StateError, match="rotation, servo 2: quick stop is not confirmed"):
                drives.stop()
        passed = servo.get(servo.family.position)
        servos.clear(Dof.ROTATION)
        until(lambda: not servos._faults[Dof.ROTATION])
        drives.stop()
        assert passed <= servo.get(goal) < far  # neither on nor back


@FAMILIES
def test_a_servo_that_restarted_is_told_to_be_without_torque(protocol: str, tmp_path: Path) -> None:
    with running(servos_config(protocol, tmp_path)) as (servos, drives):
        drive(drives, 3)
        servos.inject("restart", Dof.ROTATION)
        with pytest.raises(FollowingError) as found:
            drive(drives, 10_000)
        (note,) = [one for one in found.value.__notes__ if "torque" in one]
        assert note.startswith("rotation, servo 2: without torque. If it restarted")


@FAMILIES
def test_a_packet_that_the_port_does_not_take_in_time_is_lost_and_the_stop_repeats_it(
    protocol: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write, packets = ServoLine.write_all, list[Register]()

    def write_some(line: ServoLine, values: dict[int, int], register: Register) -> None:
        packets.append(register)
        if len(packets) in (1, 3, 5):
            raise NoAnswerError("Operation timed out")
        write(line, values, register)

    with running(servos_config(protocol, tmp_path)) as (servos, drives):
        drive(drives, 3)
        monkeypatch.setattr(ServoLine, "write_all", write_some)
        drive(drives, 2)
        drives.stop()
        assert goals_are_positions(servos)
        assert len(packets) >= 3


@FAMILIES
def test_fault_persists_until_it_is_reset(protocol: str, tmp_path: Path) -> None:
    config = servos_config(protocol, tmp_path)
    with SimulatedServos(config, start=START) as servos:
        servos.inject("fault", Dof.BENDING)
        until(lambda: bool(servos.events))
        with open_drives(config) as drives, pytest.raises(StateError, match=r"bending.*overload"):
            drives.start()
        servos.clear(Dof.BENDING)
        with open_drives(config) as drives:
            position = drives.start(reset_faults=True)
            np.testing.assert_allclose(position, START, atol=2e-3)


def test_a_stop_while_servos_are_enabled_holds_them_where_the_reset_left_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    reset = Servo.reset_fault

    def reset_and_move(servo: Servo, before: int) -> int:
        moved = motors.servos[0]
        moved.set(moved.family.position, before + 300)
        return reset(servo, before)

    config = servos_config("feetech", tmp_path)
    with SimulatedServos(config, start=START) as motors:
        before = motors.servos[0].get(motors.servos[0].family.position)
        motors.inject("fault", Dof.INSERTION)
        until(lambda: bool(motors.events))
        motors.clear(Dof.INSERTION)
        monkeypatch.setattr(Servo, "reset_fault", reset_and_move)
        read = Servo.read

        def without_torque(servo: Servo, register: Register) -> int:
            is_second = servo.id == 2 and register == motors.servos[0].family.torque
            return 0 if is_second else read(servo, register)

        monkeypatch.setattr(Servo, "read", without_torque)
        with open_drives(config) as drives, pytest.raises(StateError, match="torque stays off"):
            drives.start(reset_faults=True)
        goal = motors.servos[0].get(motors.servos[0].family.goal)
    assert goal > before + 100, "not back to where it was before the reset"


@FAMILIES
@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        (
            {"node": 9},
            SilentDriveError,
            "rotation.node.*ids [123, ]+ answer at 1000000",
        ),  # each, unless the computer is busy
        ({}, ModeRefusedError, "it is a .* not a .*Correct drives.rotation.model"),
        ({"counts_per_unit": 1e5, "travel": [-100.0, 0.0]}, SettingRefusedError, "It counts to"),
    ],
    ids=["id", "model", "turns"],
)
def test_wrong_configuration_is_named_before_anything_moves(
    protocol: str,
    tmp_path: Path,
    changes: dict[str, Any],
    error: type[DriveError],
    message: str,
) -> None:
    rotation = AXES["rotation"] | {"model": MODELS[protocol]} | changes
    config = servos_config(protocol, tmp_path, rotation=rotation, request_timeout=0.2)
    with SimulatedServos(servos_config(protocol, tmp_path), start=START) as servos:
        if not changes:  # another model is connected
            servos.servos[1].set(servos.servos[1].family.model, 2825)
        with pytest.raises(error, match=message):
            open_drives(config)
        findings = {one.what: one for one in check_drives(config) if one.status == "missing"}
        assert len(findings) == 1
        assert any("rotation" in what for what in findings)
        assert not servos.events


@FAMILIES
def test_position_outside_the_travel_and_missing_port(protocol: str, tmp_path: Path) -> None:
    config = servos_config(protocol, tmp_path)
    with pytest.raises(BusError, match=r"cannot be opened.*drives\.channel"):
        open_drives(config)
    for lower in (1.0, START[Dof.BENDING] + 0.01):  # by more and by less than a following error
        bending = AXES["bending"] | {"model": MODELS[protocol], "travel": [lower, 2.0]}
        with (
            SimulatedServos(config, start=START),
            open_drives(servos_config(protocol, tmp_path, bending=bending)) as drives,
            pytest.raises(FollowingError, match="outside its travel") as found,
        ):
            drives.start()
        assert "drives.bending.home" in str(found.value)


@FAMILIES
def test_doctor_finds_all_there_and_enables_nothing(protocol: str, tmp_path: Path) -> None:
    config = servos_config(protocol, tmp_path)
    with SimulatedServos(config, start=START) as servos:
        findings = check_drives(config)
        assert not servos.events
    assert [one.what for one in findings if one.status == "missing"] == []
    text = "; ".join(one.found for one in findings)
    assert MODELS[protocol] in text
    assert "torque off; no fault" in text
    assert "°C" in text


def test_doctor_finds_servos_that_answer_at_another_rate_missing(tmp_path: Path) -> None:
    config = servos_config("dynamixel", tmp_path)
    wrong = servos_config("dynamixel", tmp_path, bitrate=115_200, request_timeout=0.2)
    with SimulatedServos(config, start=START):
        found = check_drives(wrong)
    assert [one.status for one in found] == ["ok", "missing", "missing", "missing"]
    assert all("answer at 1000000 bit/s" in one.todo for one in found[1:])


def test_a_servo_that_its_watchdog_stopped_does_not_move_before_a_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = {"model": MODELS["dynamixel"], "speed_limit": 0.1}
    axes = {name: axis | slow for name, axis in AXES.items()}
    config = servos_config("dynamixel", tmp_path, heartbeat_timeout=0.2, **axes)
    demands: list[np.ndarray] = []

    def plant(demand: np.ndarray) -> np.ndarray:
        demands.append(demand)
        return demand

    write, moves = SimulatedServo.write, list[bool]()

    def note(servo: SimulatedServo, *what: Any) -> int:
        error = write(servo, *what)
        family = servo.family
        distance = abs(servo.get(family.goal) - servo.get(family.position))
        is_on = servo.get(family.torque) and servo.get(family.watchdog) != 255  # type: ignore[arg-type]
        moves.append(bool(is_on) and distance > 1)
        return error

    with SimulatedServos(config, plant, start=START) as motors:
        killed = ServoDrives(config)
        for dof in config.all_motors:
            killed.commission(dof)
        positions = killed.read_positions()
        killed.start(positions)
        killed.enable(reset_faults=False)
        killed.exchange([position + 100_000 for position in positions])
        killed.close()  # without a stop
        until(lambda: sum(one.what == "bus watchdog" for one in motors.events) == 3)
        assert not goals_are_positions(motors)
        demands.clear()
        monkeypatch.setattr(SimulatedServo, "write", note)
        memory = [bytes(one.memory) for one in motors.servos]
        findings = check_drives(config)
        assert [bytes(one.memory) for one in motors.servos] == memory
        assert {one.status for one in findings} == {"ok", "note"}
        with open_drives(config) as drives:
            drives.start()
            drive(drives, 1, speed=np.zeros(3))
        assert moves
        assert not any(moves)
        assert len(demands) > 1
        np.testing.assert_allclose(demands, [demands[0]] * len(demands), atol=1e-9)


def test_lost_answers_are_counted_for_the_servo_that_is_silent(tmp_path: Path) -> None:
    """The others are read one by one meanwhile, and the motion goes on."""
    with running(servos_config("dynamixel", tmp_path)) as (
        servos,
        drives,
    ):
        late = drives.statistics.late
        servos.inject("drop", Dof.BENDING)
        until(lambda: drives.exchange(drives.last_command) is not None and late[Dof.BENDING] > 3)
        assert late[Dof.BENDING] > late[Dof.INSERTION]
        servos.clear(Dof.BENDING)
        drive(drives, 10)
