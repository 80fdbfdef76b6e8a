"""How fast and how far an operator may move the reference."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.dof import Dof

Floats = NDArray[np.float64]
TRAVEL_MARGIN = 0.25
"""Distance of reference and command from the travel [in width_limit], but at most a quarter of the
travel."""
TWIN_TRAVEL = 4 / 3
"""Travel of the reference in the twin about the start position [in amplitudes]."""


class MotionLimits(NamedTuple):
    """Limits of the reference; every (n,) is [m or rad], or that per s.

    Attributes:
        speed: (n,) largest speed that the loop follows.
        least: (n,) least reference.
        most: (n,) largest reference.
        start: (n,) where the program "home" ends.
    """

    speed: Floats
    least: Floats
    most: Floats
    start: Floats


def motion_limits(config: Config) -> MotionLimits:
    """The limits in a configuration."""
    if config.dof:
        speed = np.array([dof.largest_speed for dof in config.dof])
        widths = np.array([dof.width_limit for dof in config.dof])
        travel = np.array([dof.travel for dof in config.dof])
        start = travel.mean(axis=1)
    else:
        speed, widths = np.array(config.safety.reference_speed), np.array(config.safety.width_limit)
        start = np.array([config.experiment[dof].centre for dof in Dof])
        if config.drives is None:
            reach = TWIN_TRAVEL * np.array([config.experiment[dof].amplitude for dof in Dof])
            return MotionLimits(speed, start - reach, start + reach, start)
        travel = np.array([config.drives[dof].travel for dof in Dof])
    margin = np.minimum(TRAVEL_MARGIN * widths, np.diff(travel)[:, 0] / 4)
    return MotionLimits(speed, travel[:, 0] + margin, travel[:, 1] - margin, start)
