"""A slow motion of one motor out and back, to check signs and distances of a rig."""

from __future__ import annotations

import time

import numpy as np

from tautscope.config import DrivesConfig
from tautscope.dof import Dof
from tautscope.errors import STOPPED, FieldError, TautscopeError
from tautscope.hardware.drives import open_drives
from tautscope.hardware.signals import exit_on_signals

DURATION = 4.0
"""Duration of the motion out and back [s]."""
LARGEST = (2e-3, 0.2, 0.2)
"""Largest distance of a first test [m, rad, rad]."""


def check_distance(dof: Dof, distance: float) -> None:
    """Check the distance of a jog [m or rad].

    Raises:
        FieldError: It is 0, not finite, or beyond `LARGEST`.
    """
    if not 0 < abs(distance) <= LARGEST[dof]:
        raise FieldError("distance", distance, f"at most {LARGEST[dof]:g} m or rad, and not 0")


def jog(config: DrivesConfig, dof: Dof, distance: float) -> tuple[float, float]:
    """Move a motor along a raised cosine by `distance` [m or rad] and back.

    THE MOTOR MOVES. It is quick-stopped at the end, and on every error.

    Returns:
        Largest displacement and displacement at the end, as the drive measured them [m or rad].

    Raises:
        FieldError: The distance is not allowed, see `check_distance`.
        DriveError: A drive is missing, differs from its configuration, or failed.
    """
    check_distance(dof, distance)
    steps = round(DURATION / config.cycle)
    with exit_on_signals(), open_drives(config) as drives:
        begin = drives.start()
        applied, due = [begin], time.monotonic()
        try:
            for step in range(steps + 1):
                command = begin.copy()
                command[dof] += distance * (1 - np.cos(2 * np.pi * step / steps)) / 2
                applied.append(drives.exchange(command))
                due += config.cycle
                time.sleep(max(0.0, due - time.monotonic()))
        except TautscopeError as error:
            error.exit_status = STOPPED
            raise
    moved = np.array(applied)[:, dof] - begin[dof]
    return float(moved[np.abs(moved).argmax()]), float(moved[-1])
