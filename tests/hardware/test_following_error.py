"""Property tests of the following error monitor."""

import itertools
from typing import Any

import numpy as np
import pytest
from drive_settings import AXES, drives_config
from numpy.typing import NDArray
from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.hardware.following_error import FollowingErrorMonitor

PERIODS = (0.002, 0.005, 0.01)
LIMIT, WINDOW = 1e-3, 0.4e-3
REST = np.zeros(3)


def config(**changes: Any) -> DrivesConfig:
    axes = {
        name: {**axis, "following_error": LIMIT, "following_window": WINDOW}
        for name, axis in AXES.items()
    }
    return drives_config(**axes, **{"lag": 0.02, "following_timeout": 0.05, **changes})


def on_insertion(value: float) -> NDArray[np.float64]:
    return np.array([value, 0.0, 0.0])


def first_exceeded(
    following: FollowingErrorMonitor, commands: NDArray[np.float64], positions: NDArray[np.float64]
) -> int | None:
    """The first period in which the following error of insertion is too large."""
    following.reset(on_insertion(positions[0]))
    for count, (command, position) in enumerate(zip(commands, positions, strict=True)):
        exceeded = following.update(on_insertion(command), on_insertion(position))
        assert not exceeded[1:].any()
        if exceeded[Dof.INSERTION]:
            return count
    return None


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("seed", range(5))
def test_motor_within_the_lag_never_exceeds_the_limits(period: float, seed: int) -> None:
    """Random commands; the motor has a dead time, then a moving average of the remaining lag."""
    chance = np.random.default_rng(seed)
    ticks = round(0.02 / period)
    commands = chance.uniform(-0.05, 0.05, 500)
    dead = int(chance.integers(0, ticks + 1))
    padded = np.concatenate([np.full(ticks, commands[0]), commands])
    behind = np.array(
        [padded[k : k + ticks - dead + 1].mean() for k in range(len(commands))], np.float64
    )
    error = chance.uniform(-WINDOW, WINDOW, len(commands)) * (1 - 1e-9)
    assert first_exceeded(FollowingErrorMonitor(config(), period), commands, behind + error) is None


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("pending", [0, 1, 3])
@pytest.mark.parametrize("late", [0.01, 0.02, 0.03, 0.06])
def test_motor_beyond_the_lag_exceeds_the_limits(period: float, pending: int, late: float) -> None:
    """At constant speed the error is the travel in the time beyond the lag."""
    speed, times = 0.06, np.arange(0.0, 1.0, period)
    positions = speed * np.maximum(times - late, 0.0)
    found = first_exceeded(
        FollowingErrorMonitor(config(), period, pending), speed * times, positions
    )
    error = speed * (late - 0.02 - pending * period)
    if error <= WINDOW:
        assert found is None
    elif error > LIMIT:
        assert found is not None
        assert found * period <= late + period
    else:
        assert found is not None
        assert 0.05 < found * period <= late + 0.05 + 2 * period


@pytest.mark.parametrize("period", PERIODS)
@pytest.mark.parametrize("side", [-1, 1])
def test_small_error_is_tolerated_until_the_timeout(period: float, side: int) -> None:
    most = round(0.05 / period)
    for length in (most - 1, most, most + 1):
        errors = np.zeros(2 * length + 4)
        errors[1 : 1 + length] = errors[3 + length : 3 + 2 * length] = side * 1.5 * WINDOW
        found = first_exceeded(
            FollowingErrorMonitor(config(), period), np.zeros(len(errors)), errors
        )
        # One position inside the window resets the timer.
        assert found == (most + 1 if length > most else None), length


def test_large_error_is_detected_at_once() -> None:
    for size in (-1.001, 1.001):
        errors = np.array([0.0, 0.999, size]) * LIMIT
        assert first_exceeded(FollowingErrorMonitor(config(), 0.005), np.zeros(3), errors) == 2


def test_each_motor_has_its_own_limits() -> None:
    following = FollowingErrorMonitor(drives_config(), 0.01)
    for dof, share in itertools.product(Dof, (0.99, 1.01)):
        following.reset(REST)
        position = np.zeros(3)
        position[dof] = share * drives_config()[dof].following_error
        expected = [share > 1 and other is dof for other in Dof]
        np.testing.assert_array_equal(following.update(REST, position), expected, f"{dof} {share}")


def test_old_positions_are_not_checked_and_hold_the_timer() -> None:
    """A late answer neither raises nor clears an error."""
    following = FollowingErrorMonitor(config(), 0.01)
    far, small = on_insertion(5 * LIMIT), on_insertion(1.5 * WINDOW)
    late = (False, True, True)
    assert not following.update(REST, far, late).any()
    for _ in range(5):
        assert not following.update(REST, small).any()
        assert not following.update(REST, REST, late).any()
    assert following.update(REST, small)[Dof.INSERTION]


def test_reset_clears_the_timer() -> None:
    following = FollowingErrorMonitor(config(), 0.01)
    for _ in range(5):
        following.update(REST, on_insertion(1.5 * WINDOW))
    start = on_insertion(0.03)
    following.reset(start)
    assert not following.update(start, start + on_insertion(1.5 * WINDOW)).any()
    np.testing.assert_array_equal(following.lower, start)
    np.testing.assert_array_equal(following.upper, start)
