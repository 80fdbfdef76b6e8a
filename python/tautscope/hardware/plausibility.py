"""Plausibility of tip and motor motion: finds wrong signs, units and broken transmissions."""

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.dof import Dof, display_text
from tautscope.errors import ConfigError
from tautscope.loop.reduction import Report

MAX_UNMEASURED_TRAVEL = 8.0
"""Travel of a motor within which a frame must measure its DOF [start deviations]."""
MAX_REVERSE_MOTION = 1.0
"""How far a tip may move against its motor [start deviations]."""
MAX_LOST_MOTION = 4.0
"""By how much the tip may move less than its motor [start deviations]; twice the expected slack."""
SUFFICIENT_RANGE = 5.0
"""Range of the motor after which a DOF has passed [start deviations]."""
MAX_GAIN = 3.0
"""Largest ratio of tip motion to motor motion."""


SLACK = 0.75
"""How far the command may have to be from the reference, on either side [expected widths]; 0.73 in
rotation on the twin."""
SHARED = (Dof.INSERTION, Dof.ROTATION)
"""DOFs that share the friction of the shaft."""


def check_experiment(config: Config) -> None:
    """Check that the drives can make the commands of ``[experiment]`` with compensation.

    These are `SLACK` ``expected_width`` beyond the reference, and at most ``free_gain`` times as
    fast. In profile ``best`` insertion and rotation share that bound, measured in ``width_limit``,
    as they share a friction: one may move while the reference moves the other.

    Raises:
        ConfigError: ``travel`` or ``speed_limit`` of a drive is too small.
    """
    if config.drives is None or config.drives.motors:
        return
    widths = config.safety.width_limit
    for dof in Dof:
        axis, sine = config.drives[dof], config.experiment[dof]
        slack = SLACK * config[dof].expected_width
        low, high = (sine.centre + sign * (sine.amplitude + slack) for sign in (-1, 1))
        experiment = f"experiment.{dof.label}"
        if not axis.travel[0] <= low < high <= axis.travel[1]:
            allowed = f"at least {low:.3g} to {high:.3g}: {experiment}, and the slack on both sides"
            allowed += f"; or less {experiment}.amplitude"
            raise ConfigError(f"{dof.key}.travel", axis.travel, allowed)
        is_shared = config.profile == "best" and dof in SHARED
        for other in SHARED if is_shared else (dof,):
            moved = config.experiment[other]
            fastest = 2 * math.pi * moved.amplitude / moved.period
            speed = config[dof].free_gain * fastest * widths[dof] / widths[other]
            if speed > axis.speed_limit:
                longer = moved.period * speed / axis.speed_limit
                allowed = f"at least {speed:.3g}, {dof.label}.free_gain times the speed of "
                allowed += f"experiment.{other.label}; or a period of that of {longer:.3g} or more"
                raise ConfigError(f"{dof.key}.speed_limit", axis.speed_limit, allowed)


class PlausibilityMonitor:
    """Compares the state estimate with the motor positions from the start of a run on.

    Per DOF, over the frames that measured it, with q the state estimate and p the motor position at
    capture,

        R = max p - min p,    D = q(at the largest p) - q(at the smallest p).

    A tip behind backlash of width w has max(0, R - w) <= D <= R. The limits are multiples of
    ``start_deviation``, half of the expected width.

    Args:
        config: Of the loop.
        applied: (3,) motor positions at the start [m, rad, rad].
    """

    def __init__(self, config: Config, applied: NDArray[np.float64]) -> None:
        self._scale = np.array([config[dof].start_deviation for dof in Dof])
        self._last = np.array(applied)
        span = round(config.control.history / config.control.period)
        self._applied: deque[tuple[float, NDArray[np.float64]]] = deque(maxlen=span)
        self._unmeasured_travel = np.zeros(3)
        self._ends: list[tuple[tuple[float, float], tuple[float, float]] | None] = [None] * 3
        """Per DOF (motor, estimate) at the smallest and at the largest motor position."""
        self._has_passed = [False] * 3

    def add_sample(self, time: float, applied: NDArray[np.float64]) -> None:
        """Add motor positions (3,) at a time of the rig's clock [s], once per control period.

        Raises:
            ConfigError: A motor travelled too far without a measurement.
        """
        self._unmeasured_travel += np.abs(applied - self._last)
        self._last = np.array(applied)
        self._applied.append((time, self._last))
        for dof in np.flatnonzero(self._unmeasured_travel > MAX_UNMEASURED_TRAVEL * self._scale):
            label = Dof(int(dof)).label
            raise ConfigError(
                f"drives.{label}",
                f"a travel of {self._unmeasured_travel[dof]:.3g} in which no frame measured it",
                "recognised markers. Check light, focus and calibration, and "
                f"drives.{label}.sign and counts_per_unit",
            )

    def check_frame(self, captured_at: float, report: Report) -> None:
        """Check the loop's report on a frame captured at a time of the rig's clock [s].

        Raises:
            ConfigError: A tip moves against its motor, too far, or not at all.
        """
        past = (applied for at, applied in reversed(self._applied) if at <= captured_at)
        motor = next(past, self._applied[0][1] if self._applied else self._last)
        for dof in Dof:
            if report.observable[dof]:
                self._unmeasured_travel[dof] = 0.0
                if not self._has_passed[dof]:
                    self._check(dof, (float(motor[dof]), float(report.state_estimate[dof])))

    def _check(self, dof: Dof, now: tuple[float, float]) -> None:
        least, largest = self._ends[dof] or (now, now)
        least, largest = min(least, now), max(largest, now)
        self._ends[dof] = least, largest
        motor, tip = largest[0] - least[0], largest[1] - least[1]
        scale, name = float(self._scale[dof]), f"drives.{dof.label}"
        tip_moved, motor_moved = (display_text([each], [dof]) for each in (tip, motor))
        moved = f"a tip that moved {tip_moved} while its motor moved {motor_moved}"
        if tip < -MAX_REVERSE_MOTION * scale:
            allowed = "motion in the same direction: the sign is wrong"
            raise ConfigError(f"{name}.sign", moved, allowed)
        if tip > MAX_GAIN * (motor + scale):
            allowed = "counts per m or rad: the value is too large"
            raise ConfigError(f"{name}.counts_per_unit", moved, allowed)
        if motor - tip > MAX_LOST_MOTION * scale:
            allowed = f"a tip that follows: the value or {dof.label}.start_deviation is too small, "
            allowed += f"{name}.sign is wrong, or the transmission is broken"
            raise ConfigError(f"{name}.counts_per_unit", moved, allowed)
        self._has_passed[dof] = motor > SUFFICIENT_RANGE * scale
