"""The tip's state from the bands of one image, without motors and without earlier images."""

import numpy as np
from numpy.typing import ArrayLike

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import SignalError
from tautscope.loop.construction import build_feature_model
from tautscope.loop.kinematics import Floats
from tautscope.loop.signal_checks import as_numbers
from tautscope.loop.vision import workspace_starts

_PIXELS = np.full(4, 0.5)  # standard deviation of a feature for the fit [px]
_BROAD = 3.0  # standard deviation of the start, in distances of the starts


def tip_states(features: ArrayLike, config: Config) -> Floats:
    """States whose features, Eq. (9), are nearest to measured ones, image by image.

    Args:
        features: (n, 4) u and v of bands A and B [px]; NaN where they were not found.
        config: Instrument, camera, and workspace of the experiment, from which the search starts.

    Returns:
        (n, 3) [m, rad, rad]; NaN for images without both bands, and for a DOF whose standard
        deviation for 1 px of noise exceeds its `observable_deviation`: the rotation of a straight
        instrument.

    Raises:
        SignalError: The features are not such an array of numbers.
    """
    allowed = "an array (n, 4) of numbers"
    values = as_numbers("features", features, allowed)
    if values.ndim != 2 or values.shape[1] != 4:
        raise SignalError("features", f"array {values.shape}", allowed)
    model = build_feature_model(config)
    starts, spread = workspace_starts(config)
    spread = _BROAD * spread
    limits = np.array([config[dof].observable_deviation for dof in Dof])
    states = np.full((len(values), 3), np.nan)
    for row, measured in zip(states, values, strict=True):
        if not np.isfinite(measured).all():
            continue
        tried = (model.nearest_state(start, spread, measured, _PIXELS) for start in starts)
        fits = [fit for fit in tried if fit is not None]
        state = min(fits, key=lambda fit: fit[1])[0] if fits else None
        if state is None or (predicted := model.predict(state)) is None:
            continue
        _, jacobian = predicted
        information = jacobian.T @ jacobian + np.diag(spread**-2)
        std = np.sqrt(np.diag(np.linalg.inv(information)))
        row[:] = np.where(std <= limits, state, np.nan)
    return states
