"""What disturbances draw on: chance that changes smoothly over frames, and where the bands are."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Light = NDArray[np.float32]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Drift:
    """Chance of one disturbance in one picture: fixed by (seed, name, sequence), smooth in it.

    Attributes:
        seed: ``twin.seed``.
        name: Of the disturbance.
        sequence: Number of the picture.
    """

    seed: int
    name: str
    sequence: int

    def generator(self, *tags: str | int) -> np.random.Generator:
        """A generator that depends on seed, name and tags, but not on the picture."""
        words = [zlib.crc32(str(tag).encode()) for tag in (self.name, *tags)]
        return np.random.default_rng([self.seed, *words])

    def wander(self, tag: str, frames: float = 40.0) -> float:
        """A value in -1 to 1 that changes over about ``frames`` pictures and reaches both ends.

        Between independent knots, v = k0 + (k1 - k0) t^2 (3 - 2 t), stretched by 1.4 and clipped.
        """
        start = self.generator(tag, "start").uniform()
        knot, t = divmod(self.sequence / frames + start, 1.0)
        k0, k1 = (self.generator(tag, int(knot) + i).uniform(-1, 1) for i in (0, 1))
        return float(np.clip(1.4 * (k0 + (k1 - k0) * t * t * (3 - 2 * t)), -1, 1))

    def episode(self, tag: str, frames: float = 50.0) -> tuple[int, float]:
        """Something that comes and goes: its number, and how much of it is there, 0 to 1.

        The second is min(1, 1.5 sin^2(pi t)) over the episode: nothing at its ends.
        """
        start = self.generator(tag, "start").uniform()
        number, t = divmod(self.sequence / frames + start, 1.0)
        return int(number), float(min(1.0, 1.5 * np.sin(np.pi * t) ** 2))

    def clouds(self, tag: str, width: int, height: int, cells: float, speed: float) -> Light:
        """Smooth noise (height, width) of about unit deviation, ``cells`` features across.

        A sum of plane waves whose phases advance by ``speed`` [rad per picture] times a number
        near one, bent by two slow ones so that no wave shows.
        """
        waves, weight, pace = _waves(self.seed, self.name, tag, height / width, cells)
        turn = speed * pace * self.sequence
        coarse = np.tensordot(
            np.concatenate([weight * np.cos(turn), weight * np.sin(turn)]), waves, 1
        )
        return np.asarray(
            cv2.resize(coarse.astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC),
            dtype=np.float32,
        )


@lru_cache(maxsize=16)
def _waves(
    seed: int, name: str, tag: str, aspect: float, cells: float
) -> tuple[Floats, Floats, Floats]:
    """What of `Drift.clouds` does not move, for a picture ``aspect`` as high as wide.

    Returns:
        Sines, then cosines, of each wave's place (2 n, rows, columns); weights (n,) that give the
        sum unit deviation; pace (n,).
    """
    chance = Drift(seed, name, 0).generator(tag)
    columns = 120
    rows = max(1, round(columns * aspect))
    x, y = np.meshgrid(np.arange(columns) / columns, np.arange(rows) / columns)
    x, y = (
        x + 0.08 * np.sin(5 * y + chance.uniform(0, 2 * np.pi)),
        y + 0.08 * np.sin(5 * x + chance.uniform(0, 2 * np.pi)),
    )
    count = np.arange(18)
    weight = 2.0 ** (-count / 6)
    turn, phase, pace = chance.uniform((0, 0, 0.6), (2 * np.pi, 2 * np.pi, 1.4), (18, 3)).T
    pitch = np.pi * cells * 2.0 ** (count / 5)
    along = np.multiply.outer(pitch * np.cos(turn), x) + np.multiply.outer(pitch * np.sin(turn), y)
    along += phase[:, None, None]
    return (
        np.concatenate([np.sin(along), np.cos(along)]),
        weight / np.sqrt(0.5 * np.sum(weight**2)),
        pace,
    )


@dataclass(frozen=True, slots=True)
class Bands:
    """The bands' near sides as drawn, in small pieces.

    Attributes:
        band: (n,) 0 for A, 1 for B.
        at: (n, 2) [px].
        area: (n,) in the picture [px^2].
        seen: (n,) inside the picture, with no part of the instrument in front.
    """

    band: NDArray[np.intp]
    at: Floats
    area: Floats
    seen: Mask

    @classmethod
    def from_surface(cls, surface: Floats) -> Bands:
        """From the rows (band, u, v, area, seen) of ``Renderer.draw_scene``.

        Pieces without area, as of a band seen end on, are left out.
        """
        surface = surface[surface[:, 3] > 0]
        return cls(
            surface[:, 0].astype(np.intp),
            surface[:, 1:3],
            surface[:, 3],
            np.asarray(surface[:, 4] > 0.5),
        )

    def some(self, count: int) -> Bands:
        """About so many of the pieces, for estimates."""
        every = slice(None, None, 2 * (len(self.area) // (2 * count)) + 1)
        return Bands(self.band[every], self.at[every], self.area[every], self.seen[every])

    def drawn(self) -> list[int]:
        """The bands of which something is in the picture."""
        return [k for k in (0, 1) if self.area[(self.band == k) & self.seen].sum() > 1]

    def centre(self, k: int) -> Floats:
        """Centroid of band k [px]."""
        mine = self.band == k
        return np.asarray(np.average(self.at[mine], axis=0, weights=self.area[mine]))

    def axis(self) -> Floats:
        """Unit vector in the picture from band A to band B; u where they fall on one place."""
        if not ((self.band == 0).any() and (self.band == 1).any()):
            return np.array([1.0, 0.0])
        way = self.centre(1) - self.centre(0)
        length = float(np.linalg.norm(way))
        return way / length if length > 1e-6 else np.array([1.0, 0.0])

    def extent(self, k: int, direction: Floats) -> float:
        """Size of band k along a unit vector [px]."""
        along = self.at[self.band == k] @ direction
        return float(np.ptp(along))

    def share(self, k: int, chosen: Mask) -> float:
        """Share of band k's area in the chosen pieces (n,), 0 to 1; 0 for no band."""
        mine = self.band == k
        total = float(self.area[mine].sum())
        return float(self.area[mine & chosen].sum()) / total if total > 0 else 0.0

    def visible(self, hidden: Mask) -> Floats:
        """Visible share (2,) of each band where the picture's ``hidden`` pixels hide it.

        Less than 1 px^2 counts as nothing.
        """
        height, width = hidden.shape
        column, row = np.rint(self.at).astype(np.intp).T
        inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        covered = np.zeros(len(self.at), dtype=bool)
        covered[inside] = hidden[row[inside], column[inside]]
        left = self.seen & ~covered
        return np.array(
            [
                self.share(k, left) if self.area[left & (self.band == k)].sum() >= 1 else 0.0
                for k in (0, 1)
            ]
        )
