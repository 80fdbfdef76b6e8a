"""Whether the tip goes where the motors go: what a wrong sign, unit or cable cannot hide from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import ConfigError
from tautscope.reduction import Report

UNSEEN, FOLLOWS, OUTRUNS = 8.0, 0.1, 3.0
"""Travel of a motor [in start deviations] after which its tip must have been seen, and have
followed at least so far [share of the travel]; how much further than its motor no tip goes."""
OPPOSITE = 2.0
"""How far a tip may go against its motor [in start deviations]."""


class Plausibility:
    """Compares what the camera sees with what the drives report, from the start of a run on.

    Per DOF, over the frames that measured it, with q the state estimate and p the motor,

        T = sum |p_k - p_(k-1)|,    C = sum sign(p_k - p_(k-1)) (q_k - q_(k-1)).

    A tip behind slack has 0 < C < T. The scale of all is ``start_deviation``, half of the slack.

    Args:
        config: Of the loop.
        applied: (3,) where the motors are at the start [m, rad, rad].
    """

    def __init__(self, config: Config, applied: NDArray[np.float64]) -> None:
        self._scale = np.array([config[dof].start_deviation for dof in Dof])
        self._last = np.array(applied)
        self._seen_at = np.array(applied)
        self._seen = np.full(3, np.nan)
        self._travel = np.zeros(3)
        self._unseen = np.zeros(3)
        self._followed = np.zeros(3)
        self._settled = np.zeros(3, dtype=bool)

    def tick(self, applied: NDArray[np.float64]) -> None:
        """Where the motors are (3,), once per control period.

        Raises:
            ConfigError: The markers have not been seen for too long a travel.
        """
        self._unseen += np.abs(applied - self._last)
        self._last = np.array(applied)
        for dof in np.flatnonzero(self._unseen > UNSEEN * self._scale):
            label = Dof(int(dof)).label
            raise ConfigError(
                f"drives.{label}",
                f"a travel of {self._unseen[dof]:.3g} in which no frame measured it",
                "markers that are seen and recognised. Look at the picture, light and focus; check "
                f"drives.{label}.sign and counts_per_unit, and the calibration",
            )

    def frame(self, report: Report) -> None:
        """What the loop made of a frame.

        Raises:
            ConfigError: A tip goes against its motor, further than it, or not at all.
        """
        for dof in Dof:
            if not report.observable[dof]:
                continue
            estimate, motor = float(report.state_estimate[dof]), float(self._last[dof])
            self._unseen[dof] = 0.0
            if np.isfinite(self._seen[dof]) and not self._settled[dof]:
                moved = motor - self._seen_at[dof]
                self._travel[dof] += abs(moved)
                self._followed[dof] += np.sign(moved) * (estimate - self._seen[dof])
                self._judge(dof)
            self._seen[dof], self._seen_at[dof] = estimate, motor

    def _judge(self, dof: Dof) -> None:
        travel, followed = float(self._travel[dof]), float(self._followed[dof])
        scale, name = float(self._scale[dof]), f"drives.{dof.label}"
        told = f"a tip that went {followed:.3g} while its motor went {travel:.3g}"
        if followed < -OPPOSITE * scale:
            raise ConfigError(f"{name}.sign", told, "one that goes with it: the sign is wrong")
        if followed > OUTRUNS * (travel + scale):
            raise ConfigError(
                f"{name}.counts_per_unit", told, "counts per m or rad: it is too large"
            )
        if travel > UNSEEN * scale:
            if followed < FOLLOWS * travel:
                raise ConfigError(
                    f"{name}.counts_per_unit",
                    told,
                    "one that follows: it is too small, or the transmission is broken",
                )
            self._settled[dof] = True
