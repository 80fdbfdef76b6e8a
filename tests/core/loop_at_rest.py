"""A loop of profile `paper` after a constant reference, and its configuration."""

import numpy as np
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.loop.reduction import HysteresisReduction

Floats = NDArray[np.float64]
CONFIG = Config(profile="paper").replace(
    **{
        "insertion.observable_deviation": 5e-3,
        "bending.observable_deviation": 0.1,
        # Without noise, images are identical while the slack is crossed.
        "safety.frozen_travel": 1e6,
    }
)
REST = np.array([0.025, 0.0, 0.9])


def loop_at_rest(ticks: int = 100, config: Config = CONFIG) -> HysteresisReduction:
    loop = HysteresisReduction(config)
    for _ in range(ticks):
        loop.step(REST)
    return loop
