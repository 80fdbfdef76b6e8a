from collections.abc import Sequence
from typing import Self

import numpy as np
from numpy.typing import NDArray

__version__: str

class MarkerDetector:
    def __new__(
        cls,
        *,
        weights: Sequence[float],
        threshold: float,
        smoothing: int,
        minimum_area: int,
        gate: float,
        entry_point: Sequence[float],
    ) -> Self: ...
    def detect(
        self, image: NDArray[np.uint8], predicted: Sequence[float] | NDArray[np.float64] | None
    ) -> tuple[NDArray[np.float64], str, NDArray[np.float64]]: ...
    def mask(self, image: NDArray[np.uint8]) -> NDArray[np.bool_]: ...

def label_regions(mask: NDArray[np.bool_]) -> NDArray[np.float64]: ...
