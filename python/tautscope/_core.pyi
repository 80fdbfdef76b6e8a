__version__: str

from typing import final

from numpy import float64, uint8
from numpy.typing import NDArray

@final
class Renderer:
    def __new__(
        cls,
        *,
        size: tuple[int, int],
        focal: tuple[float, float],
        centre: tuple[float, float],
        distortion: tuple[float, float, float, float, float, float, float, float],
        translation: tuple[float, float, float],
        rotation: tuple[float, float, float],
        diameter: float,
        bending_length: float,
        tip_length: float,
        markers: tuple[float, float],
        band_length: float,
        noise: float,
        seed: int,
    ) -> Renderer: ...
    def draw(
        self,
        background: NDArray[uint8],
        points: NDArray[float64],
        directions: NDArray[float64],
        sequence: int,
    ) -> tuple[NDArray[uint8], NDArray[float64]]: ...
