"""The play of Eq. (1) in three lines, independent of the package's."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def play(
    v: ArrayLike, delta_minus: float, delta_plus: float, start: float | None = None
) -> NDArray[np.float64]:
    v = np.asarray(v, dtype=float)
    y = np.empty_like(v)
    last = v[0] - delta_plus if start is None else start
    for index, value in enumerate(v):
        last = y[index] = min(max(last, value - delta_plus), value - delta_minus)
    return y
