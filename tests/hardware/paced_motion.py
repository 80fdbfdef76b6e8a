"""Motions of drives under test, and what every family of motors on a line does."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

import numpy as np
from tautscope.bench.line_motors import LineMotors
from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.hardware.drives import Drives, open_drives
from waiting import until

Motors = TypeVar("Motors", bound=LineMotors)
SPEED = np.array([0.005, 0.5, 0.4])


def drive(drives: Drives, cycles: int, speed: np.ndarray = SPEED) -> None:
    """Move back and forth, paced."""
    command = drives.last_command
    for count in range(cycles):
        command = command + speed * drives.cycle * (1 if count // 40 % 2 == 0 else -1)
        drives.exchange(command)
        time.sleep(drives.cycle / 2)


@contextmanager
def running_line(
    make: Callable[..., Motors], start: np.ndarray, config: DrivesConfig
) -> Iterator[tuple[Motors, Drives]]:
    """Simulated motors and their master, enabled."""
    with make(config, start=start) as motors, open_drives(config) as drives:
        drives.start()
        yield motors, drives


def follow_in_si_units(
    make: Callable[..., Motors], config: DrivesConfig, start: np.ndarray
) -> Motors:
    """The plant and the drives follow commands over more than a turn, to a count."""
    demands: list[np.ndarray] = []

    def plant(demand: np.ndarray) -> np.ndarray:
        demands.append(demand.copy())
        return demand

    resolution = np.array([1 / config[dof].counts_per_unit for dof in Dof])
    with make(config, plant, start=start) as motors, open_drives(config) as drives:
        position = drives.start()
        assert (abs(position - start) <= resolution).all()
        goal = start + np.array([0.05, 7.0, -3.2])
        for step in range(1, 201):
            drives.exchange(start + (goal - start) * step / 200)
            time.sleep(drives.cycle / 4)
        until(lambda: bool((abs(drives.exchange(goal) - goal) <= resolution).all()))
        assert (abs(demands[-1] - goal) <= resolution).all()
    return motors
