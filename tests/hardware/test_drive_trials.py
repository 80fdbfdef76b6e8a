"""A trial of benchmarks/drives finds what moved after a fault, and judges how it ended."""

import math
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from drives import __main__ as drives
from drives.__main__ import run, with_motors
from drives.faults import FAULTS, STOP_MARGIN, Fault, setpoints
from drives.trial import Trial
from tautscope.bench.events import Event
from tautscope.bench.servo_packets import SYNC_WRITE, DynamixelPackets, FeetechPackets
from tautscope.config import Config, load_config


def bench(protocol: str) -> Config:
    """Three motors with long timeouts, for a busy computer."""
    times = {"heartbeat_timeout": 0.4, "reply_timeout": 9e-3, "lag": 0.2, "following_timeout": 0.2}
    return with_motors(load_config(f"bench_{protocol}"), 3).replace(
        **{f"drives.{name}": value for name, value in times.items()}
    )


def fault(what: str) -> Fault:
    return next(each for each in FAULTS if each.what.startswith(what))


def test_after_the_end_of_the_controller_only_a_watchdog_stops_motors() -> None:
    for protocol, has_watchdog in (("dynamixel", True), ("feetech", False)):
        killed = fault("controller killed")
        trial = run(bench(protocol), killed)
        stopped = trial.stopped()
        assert len(stopped) == 3
        assert all((0.3 < each < math.inf) == has_watchdog for each in stopped)
        assert killed.is_right(trial, protocol)


@pytest.mark.parametrize("what", ["controller killed", "controller stopped"])
@pytest.mark.parametrize("protocol", ["canopen", "dynamixel", "serial", "feetech"])
def test_a_watchdog_must_stop_every_motor_in_time(what: str, protocol: str) -> None:
    silent, has_watchdog = fault(what), protocol != "feetech"
    late = STOP_MARGIN + 0.01
    for second, is_right in ((0.4, True), (0.4 + late, not has_watchdog), (None, not has_watchdog)):
        assert silent.is_right(trial_of(0.39, second), protocol) == is_right


def trial_of(*stops: float | None) -> Trial:
    """A trial in which motors stopped by themselves, or never."""
    config = with_motors(load_config("bench_dynamixel"), len(stops)).drives
    assert config is not None
    config = msgspec.structs.replace(config, heartbeat_timeout=0.4)
    motors = zip(config.all_motors, stops, strict=True)
    events = [Event(7.0 + at, motor.label, "silence") for motor, at in motors if at is not None]
    bus: Any = SimpleNamespace(events=events)
    unused: Any = None
    return Trial(0, bus, config, unused, happened=7.0)


def test_trials_in_which_a_motor_never_stops_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    trials = iter([trial_of(0.1, 0.2), trial_of(0.1, None), trial_of(None, None)])
    monkeypatch.setattr(drives, "run", lambda *_: next(trials))
    row = drives.repeated(bench("dynamixel"), fault("controller killed"), 3)
    assert (row["right"], row["of"], row["never"]) == (1, 3, 2)
    assert row["stop_ms"] == pytest.approx(200)
    assert "| 200 ms, 2 never |" in list(drives.tables({"faults": [row]}))[-1]


def test_the_error_must_be_the_right_one_of_the_right_motor() -> None:
    overload, blocked = fault("a motor's fault"), fault("a motor blocked")
    trial = run(bench("dynamixel"), overload)
    assert overload.is_right(trial, "dynamixel")
    assert not blocked.is_right(trial, "dynamixel")
    trial.said[0]["message"] = trial.said[0]["message"].replace("joint_2", "joint_3")
    assert not overload.is_right(trial, "dynamixel")
    far, _ = trial.moved()
    assert far[1] < 0.02  # it has no torque


@pytest.mark.parametrize("codec", [DynamixelPackets(), FeetechPackets()])
def test_set_points_of_another_program_are_packets_of_the_protocol(
    codec: DynamixelPackets | FeetechPackets,
) -> None:
    protocol = "dynamixel" if isinstance(codec, DynamixelPackets) else "feetech"
    (packet,) = codec.split(bytearray(setpoints(protocol, [100, 2000, 3], 0)))
    assert packet.instruction == SYNC_WRITE
    assert packet.is_intact
    assert (2000).to_bytes(2, "little") in packet.data
