"""What following errors do not show: a jump among the recent commands, answers that are late."""

import numpy as np
import pytest
from drive_settings import drives_config
from tautscope.errors import FollowingError, SilentDriveError
from tautscope.hardware.drive_group import Feedback
from tautscope.hardware.drive_monitor import DriveMonitor

COUNTS_PER_M = 1e6
CYCLES = 10


def position_after_a_ramp(at: float, age: int) -> float:
    """Of a motor that rests under rising commands, misses `age` answers, and is then there [m]."""
    config = drives_config(lag=0.2)
    monitor = DriveMonitor(config, ("insertion", "rotation", "bending"), pending=0)
    others = (Feedback(), Feedback())
    monitor.reset((Feedback(), *others))
    ramp = config.insertion.speed_limit * config.cycle * np.arange(CYCLES)
    for tick, command in enumerate(ramp[:-1]):
        silent = Feedback(age=max(0, tick - (CYCLES - 2 - age)))
        monitor.check(np.array([command, 0.0, 0.0]), (silent, *others))
    last = Feedback(position=round(COUNTS_PER_M * at))
    return float(monitor.check(np.array([ramp[-1], 0.0, 0.0]), (last, *others))[0])


def test_a_jump_is_more_than_twice_the_speed_limit_allows() -> None:
    """Two cycles and the following error: 2 x 0.15 m/s x 0.04 s + 4 mm."""
    with pytest.raises(
        FollowingError, match=r"insertion: its position jumped by 0\.0161 in a cycle"
    ):
        position_after_a_ramp(16.1e-3, age=0)
    assert position_after_a_ramp(15.9e-3, age=0) == pytest.approx(15.9e-3)


def test_a_motor_that_was_silent_may_have_moved_farther() -> None:
    assert position_after_a_ramp(16.1e-3, age=3) == pytest.approx(16.1e-3)


def test_answers_that_all_come_late_are_silence() -> None:
    """Of a blocked motor nothing else would end the run; one answer in time begins anew."""
    config = drives_config(heartbeat_timeout=0.2)
    monitor = DriveMonitor(config, ("insertion", "rotation", "bending"), pending=1)
    late, others = Feedback(age=1, silence=1e-3), (Feedback(), Feedback())
    start = monitor.reset((Feedback(), *others))
    step = np.array([config.insertion.speed_limit * config.cycle, 0.0, 0.0])
    most = round(config.heartbeat_timeout / config.cycle)
    for _ in range(most):
        monitor.check(start, (late, *others))
    monitor.check(start, (Feedback(), *others))
    for tick in range(most):
        monitor.check(start + step * tick, (late, *others))
    with pytest.raises(SilentDriveError, match=r"insertion: no answer to 11 set-points in time"):
        monitor.check(start + step * most, (late, *others))
