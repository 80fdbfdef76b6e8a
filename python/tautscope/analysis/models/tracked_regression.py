"""Linear regression of the tip whose coefficients are tracked by Kalman filters."""

import numpy as np

from tautscope._core import track_coefficients
from tautscope.analysis.models.task import Floats

NOISE = 1e-3
"""Standard deviation of a measured tip."""
UNKNOWN = 10.0
"""Prior standard deviation of the disturbance."""


def track(
    features: Floats, travel: Floats, tips: Floats, *, spread: float, walks: Floats
) -> Floats:
    """Predict the tip by filters that differ in their process noise.

        y_k = f_k^T w_k + d_k + v_k,   v_k ~ N(0, NOISE^2)
        w, d: random walks in the travel of the command

    f are the features, w their coefficients, d the disturbance: what the features do not explain.

    Args:
        features: (n, m).
        travel: (n,) travel of the command since the start.
        tips: (n,) the tip, NaN where it was not measured.
        spread: Prior standard deviation of each coefficient; the prior mean of the first is 1, that
            of the others 0.
        walks: (k, 2) standard deviation after a travel of 1 of disturbance and coefficients, the
            latter as a share of `spread`; one row per filter.

    Returns:
        (n, k) predicted tip; NaN up to the first measured tip. Sample j uses the tips before j.
    """
    samples, size = features.shape
    coefficients = (walks[:, 1:] * spread) ** 2
    return track_coefficients(
        np.column_stack([features, np.ones(samples)]),
        travel,
        tips,
        mean=np.arange(size + 1) == 0,
        variance=np.append(np.full(size, spread**2), UNKNOWN**2),
        growth=np.column_stack([np.repeat(coefficients, size, axis=1), walks[:, :1] ** 2]),
        noise=NOISE,
    )
