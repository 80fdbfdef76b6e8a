"""The hysteresis estimator applied to a record, sample by sample."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope._core import Estimator
from tautscope.errors import SignalError

Floats = NDArray[np.float64]


def predict_tip(
    command: ArrayLike, measured: ArrayLike, estimator: Estimator
) -> tuple[Floats, Floats, Floats]:
    """Predict each tip position of a record before the estimator is updated with it.

    Runs Eqs. (1) and (4)-(6) over the samples in their order: each is predicted from the command so
    far and the offsets estimated from earlier samples, then used for an update. The sampling may
    be uneven: nothing depends on time.

    Args:
        command: (n,) actuator position, any unit.
        measured: (n,) tip position in the same unit; in contact, an actuator travel of 1 moves the
            tip by 1.
        estimator: A new one; it is updated, and would continue from its estimates.

    Returns:
        predicted (n,), delta_minus (n,), delta_plus (n,). Causal: ``predicted[k]`` uses
        ``command[:k + 1]`` and ``measured[:k]`` only. The offsets are those after sample k.

    Raises:
        SignalError: Command or measured is not finite, or their lengths differ.
    """
    command = _signal("command", command)
    measured = _signal("measured", measured)
    if len(command) != len(measured):
        allowed = f"as many as command: {len(command)}"
        raise SignalError("measured", f"{len(measured)} samples", allowed)
    return estimator.run(command, measured)


def _signal(name: str, values: ArrayLike) -> Floats:
    signal = np.ascontiguousarray(values, dtype=np.float64)
    if signal.ndim != 1:
        raise SignalError(name, f"an array of shape {signal.shape}", "a signal of shape (n,)")
    bad = np.flatnonzero(~np.isfinite(signal))
    if len(bad):
        raise SignalError(f"{name}[{bad[0]}]", float(signal[bad[0]]), "a finite number")
    return signal
