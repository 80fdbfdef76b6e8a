"""The visible sides of the marker bands as the renderer drew them, in small patches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Bands:
    """Surface patches of both bands, of the sides that face the camera.

    Attributes:
        band: (n,) 0 for band A, 1 for band B.
        pixels: (n, 2) u and v of each patch [px].
        area: (n,) area of each patch in the image [px^2].
        is_visible: (n,) inside the image and not occluded by the instrument.
    """

    band: NDArray[np.intp]
    pixels: Floats
    area: Floats
    is_visible: Mask

    @classmethod
    def from_surface(cls, surface: Floats) -> Bands:
        """Patches from the rows (band, u, v, area, visible) of ``Renderer.draw_scene``.

        Patches without area in the image are left out.
        """
        surface = surface[surface[:, 3] > 0]
        band, pixels, area, is_visible = np.split(surface, [1, 3, 4], axis=1)
        return cls(band[:, 0].astype(np.intp), pixels, area[:, 0], is_visible[:, 0] > 0.5)

    def subsample(self, count: int) -> Bands:
        """Every n-th patch, about ``count`` in all."""
        every = slice(None, None, 2 * (len(self.area) // (2 * count)) + 1)
        return Bands(self.band[every], self.pixels[every], self.area[every], self.is_visible[every])

    def visible_bands(self) -> list[int]:
        """Bands of which more than 1 px^2 is visible."""
        return [k for k in (0, 1) if self.area[(self.band == k) & self.is_visible].sum() > 1]

    def centre(self, k: int) -> Floats:
        """Centroid of band k [px]."""
        mine = self.band == k
        return np.asarray(np.average(self.pixels[mine], axis=0, weights=self.area[mine]))

    def axis(self) -> Floats:
        """Unit vector in the image from band A to band B; the u axis where they coincide."""
        if not ((self.band == 0).any() and (self.band == 1).any()):
            return np.array([1.0, 0.0])
        offset = self.centre(1) - self.centre(0)
        length = float(np.linalg.norm(offset))
        return offset / length if length > 1e-6 else np.array([1.0, 0.0])

    def extent(self, k: int, direction: Floats) -> float:
        """Size of band k along a unit vector [px]."""
        return float(np.ptp(self.pixels[self.band == k] @ direction))

    def area_share(self, k: int, selected: Mask) -> float:
        """Share of band k's area in the selected patches (n,), 0 to 1; 0 without the band."""
        mine = self.band == k
        total = float(self.area[mine].sum())
        return float(self.area[mine & selected].sum()) / total if total > 0 else 0.0

    def visible_shares(self, hidden: Mask) -> Floats:
        """Visible share (2,) of each band behind the mask ``hidden`` (height, width).

        A visible area below 1 px^2 counts as 0.
        """
        height, width = hidden.shape
        column, row = np.rint(self.pixels).astype(np.intp).T
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        covered = np.zeros(len(self.pixels), dtype=bool)
        covered[inside] = hidden[row[inside], column[inside]]
        visible = self.is_visible & ~covered
        return np.array(
            [
                self.area_share(k, visible)
                if self.area[visible & (self.band == k)].sum() >= 1
                else 0.0
                for k in (0, 1)
            ]
        )
