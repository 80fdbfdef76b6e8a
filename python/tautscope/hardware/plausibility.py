"""Whether the tip goes where the motors go: what a wrong sign, unit or cable cannot hide from."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.loop.reduction import Report

UNSEEN = 8.0
"""Travel of a motor after which its tip must have been seen [in start deviations]."""
OPPOSITE = 1.0
"""How far a tip may seem to go against its motor [in start deviations]."""
LARGEST_SLACK = 4.0
"""By how much less than its motor a tip may go [in start deviations], twice the slack expected."""
SETTLED = 5.0
"""Range of the motor after which a tip that went with it is believed [in start deviations]."""
OUTRUNS = 3.0
"""How many times as far as its motor no tip goes."""


class Plausibility:
    """Compares what the camera sees with what the drives report, from the start of a run on.

    Per DOF, over the frames that measured it, with q the state estimate and p the motor when the
    frame was captured,

        R = max p - min p,    D = q(where p was largest) - q(where p was smallest).

    A tip behind slack w has max(0, R - w) <= D <= R, whatever the motor did between. The scale of
    all is ``start_deviation``, half of the slack.

    Args:
        config: Of the loop.
        applied: (3,) where the motors are at the start [m, rad, rad].
    """

    def __init__(self, config: Config, applied: NDArray[np.float64]) -> None:
        self._scale = np.array([config[dof].start_deviation for dof in Dof])
        self._last = np.array(applied)
        span = round(config.control.history / config.control.period)
        self._applied: deque[tuple[float, NDArray[np.float64]]] = deque(maxlen=span)
        self._unseen = np.zeros(3)
        self._ends: list[tuple[tuple[float, float], tuple[float, float]] | None] = [None] * 3
        """Per DOF (motor, estimate) at the least and at the largest position of the motor."""
        self._settled = [False] * 3

    def tick(self, time: float, applied: NDArray[np.float64]) -> None:
        """Where the motors are (3,) at a time of the rig's clock [s], once per control period.

        Raises:
            ConfigError: The markers have not been seen for too long a travel.
        """
        self._unseen += np.abs(applied - self._last)
        self._last = np.array(applied)
        self._applied.append((time, self._last))
        for dof in np.flatnonzero(self._unseen > UNSEEN * self._scale):
            label = Dof(int(dof)).label
            raise ConfigError(
                f"drives.{label}",
                f"a travel of {self._unseen[dof]:.3g} in which no frame measured it",
                "markers that are seen and recognised. Look at the picture, light and focus; check "
                f"drives.{label}.sign and counts_per_unit, and the calibration",
            )

    def frame(self, captured_at: float, report: Report) -> None:
        """What the loop made of a frame captured at a time of the rig's clock [s].

        Raises:
            ConfigError: A tip goes against its motor, further than it, or not at all.
        """
        motor = self._at(captured_at)
        for dof in Dof:
            if report.observable[dof]:
                self._unseen[dof] = 0.0
                if not self._settled[dof]:
                    self._judge(dof, (float(motor[dof]), float(report.state_estimate[dof])))

    def _at(self, time: float) -> NDArray[np.float64]:
        """Where the motors were; a frame is older than they are by the camera's delay."""
        for at, applied in reversed(self._applied):
            if at <= time:
                return applied
        return self._applied[0][1] if self._applied else self._last

    def _judge(self, dof: Dof, now: tuple[float, float]) -> None:
        least, largest = self._ends[dof] or (now, now)
        least, largest = min(least, now), max(largest, now)
        self._ends[dof] = least, largest
        motor, tip = largest[0] - least[0], largest[1] - least[1]
        scale, name = float(self._scale[dof]), f"drives.{dof.label}"
        told = f"a tip that went {tip:.3g} while its motor went {motor:.3g}"
        if tip < -OPPOSITE * scale:
            raise ConfigError(f"{name}.sign", told, "one that goes with it: the sign is wrong")
        if tip > OUTRUNS * (motor + scale):
            raise ConfigError(
                f"{name}.counts_per_unit", told, "counts per m or rad: it is too large"
            )
        if motor - tip > LARGEST_SLACK * scale:
            raise ConfigError(
                f"{name}.counts_per_unit",
                told,
                f"one that follows: it is too small, {name}.sign is wrong, the transmission is "
                f"broken, or {dof.label}.start_deviation, half of the slack, is too small",
            )
        self._settled[dof] = motor > SETTLED * scale
