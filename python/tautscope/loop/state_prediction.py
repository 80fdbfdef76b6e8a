"""The state of the instrument predicted for the time an image was captured."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class StatePrediction:
    """Predicted state (prior) of the instrument at one time, with its standard deviations.

    Attributes:
        state: (3,) [m, rad, rad].
        std: (3,) standard deviation of each DOF by itself [m, rad, rad].
        geometry: (3,) what images have found of the geometry: unevenness of the section, shift u, v
            of the image [px].
    """

    state: NDArray[np.float64]
    std: NDArray[np.float64]
    geometry: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
