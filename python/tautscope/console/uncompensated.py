"""The tip without compensation, for the operator to compare with, and both tracking errors."""

from collections import deque
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from tautscope.loop.kinematics import Floats

MODEL = "the model with the estimated slack"
SECOND_PLANT = "a second simulated instrument"
WINDOW = 60
"""Length of the score [s]."""


@runtime_checkable
class ComparedRig(Protocol):
    """A simulated rig with a second instrument that gets references in place of commands."""

    def step_uncompensated(self, reference: Floats) -> Floats:
        """True tip (n,) [m or rad] of the second instrument one control period later."""


class PlayTip:
    """The tip by plays, Eq. (1), with the reference u as input: what compensation would leave.

    q <- clamp(q, u - delta_plus, u - delta_minus), per DOF, with the offsets as estimated now.

    Wrong when the slack is not that of a play, when DOFs share a friction, and as far as the
    estimate is.
    """

    def __init__(self, tip: ArrayLike) -> None:
        self.tip = np.array(tip, np.float64)

    def step(self, reference: Floats, delta_minus: Floats, delta_plus: Floats) -> Floats:
        """The tip (n,) [m or rad] for a reference and offsets (n,) [m or rad]."""
        self.tip = np.clip(self.tip, reference - delta_plus, reference - delta_minus)
        return self.tip


class Score:
    """RMS tracking errors of the last minute of motion, with and without compensation.

    e = sqrt(mean((tip - reference)^2)) per DOF, over the ticks in which its reference moved and
    the loop compensated, of the last `WINDOW` s of these; a tick takes `period` s.
    """

    def __init__(self, count: int, period: float) -> None:
        self._ticks = max(round(1 / period), 1)  # of a second, which is one entry of the sums
        self._sums: deque[Floats] = deque(maxlen=WINDOW)
        self._sum, self._added = np.zeros((3, count)), 0
        self._before: Floats | None = None

    def add(self, reference: Floats, tip: Floats, uncompensated: Floats) -> None:
        """Add a compensated tick; each (n,) [m or rad], NaN where the tip is not known."""
        before, self._before = self._before, reference
        if before is None or (before == reference).all():
            return
        known = np.isfinite(tip) & (before != reference)
        errors = np.array([np.where(known, tip, reference), uncompensated]) - reference
        self._sum += np.vstack([known * errors**2, known])
        self._added += 1
        if self._added == self._ticks:
            self._sums.append(self._sum)
            self._sum, self._added = np.zeros_like(self._sum), 0

    @property
    def errors(self) -> list[tuple[float, float] | None]:
        """Per DOF the errors with and without [m or rad]; None before a second of motion."""
        squares, without, counts = np.sum([np.zeros_like(self._sum), *self._sums], axis=0)
        return [
            (float(np.sqrt(a / n)), float(np.sqrt(b / n))) if n else None
            for a, b, n in zip(squares, without, counts, strict=True)
        ]
