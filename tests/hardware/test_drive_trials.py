"""A trial of benchmarks/drives finds what moved after a fault, and judges how it ended."""

import pytest
from drives.__main__ import run, with_motors
from drives.faults import FAULTS, Fault, setpoints
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
        assert (stopped is not None) == has_watchdog
        assert stopped is None or stopped > 0.3
        assert killed.is_right(trial, protocol)


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
