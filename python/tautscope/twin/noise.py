"""Seeded random values and textures that change smoothly from frame to frame (value noise)."""

import zlib
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Texture = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class TemporalNoise:
    """Random numbers of one disturbance at one frame: a smooth function of the frame number."""

    seed: int
    name: str
    sequence: int

    def generator(self, *tags: str | int) -> np.random.Generator:
        """Random generator that depends on seed, name and tags, but not on the frame."""
        words = [zlib.crc32(str(tag).encode()) for tag in (self.name, *tags)]
        return np.random.default_rng([self.seed, *words])

    def scalar(self, tag: str, frames: float = 40.0) -> float:
        """Random value in -1 to 1 that changes over about ``frames`` frames.

        Between independent knots v = k0 + (k1 - k0) t^2 (3 - 2 t), scaled by 1.4 and clipped, so
        that both ends are reached.
        """
        start = self.generator(tag, "start").uniform()
        knot, t = divmod(self.sequence / frames + start, 1.0)
        k0, k1 = (self.generator(tag, int(knot) + i).uniform(-1, 1) for i in (0, 1))
        return float(np.clip(1.4 * (k0 + (k1 - k0) * t * t * (3 - 2 * t)), -1, 1))

    def episode(self, tag: str, frames: float = 50.0) -> tuple[int, float]:
        """Number of the current episode, and its strength min(1, 1.5 sin^2(pi t)), 0 to 1."""
        start = self.generator(tag, "start").uniform()
        number, t = divmod(self.sequence / frames + start, 1.0)
        return int(number), float(min(1.0, 1.5 * np.sin(np.pi * t) ** 2))

    def field(self, tag: str, width: int, height: int, cells: float, speed: float) -> Texture:
        """Noise texture (height, width) of about unit standard deviation, ``cells`` features wide.

        A sum of plane waves on warped coordinates, which hide the wave pattern. The phases advance
        by ``speed`` [rad per frame] times a random factor near one.
        """
        waves, weight, pace = _plane_waves(self.seed, self.name, tag, height / width, cells)
        turn = speed * pace * self.sequence
        coarse = np.tensordot(
            np.concatenate([weight * np.cos(turn), weight * np.sin(turn)]), waves, 1
        )
        return np.asarray(
            cv2.resize(coarse.astype(np.float32), (width, height), interpolation=cv2.INTER_CUBIC),
            dtype=np.float32,
        )


@lru_cache(maxsize=16)
def _plane_waves(
    seed: int, name: str, tag: str, aspect: float, cells: float
) -> tuple[Floats, Floats, Floats]:
    """Constant part of `TemporalNoise.field` for an image with height / width = ``aspect``.

    Returns:
        Sine, then cosine, of the phase of each wave (2 n, rows, columns); weights (n,) that give
        the sum unit standard deviation; speed factors (n,).
    """
    rng = TemporalNoise(seed, name, 0).generator(tag)
    columns = 120
    rows = max(1, round(columns * aspect))
    x, y = np.meshgrid(np.arange(columns) / columns, np.arange(rows) / columns)
    x, y = (
        x + 0.08 * np.sin(5 * y + rng.uniform(0, 2 * np.pi)),
        y + 0.08 * np.sin(5 * x + rng.uniform(0, 2 * np.pi)),
    )
    count = np.arange(18)
    weight = 2.0 ** (-count / 6)
    turn, phase, pace = rng.uniform((0, 0, 0.6), (2 * np.pi, 2 * np.pi, 1.4), (18, 3)).T
    pitch = np.pi * cells * 2.0 ** (count / 5)
    along = np.multiply.outer(pitch * np.cos(turn), x) + np.multiply.outer(pitch * np.sin(turn), y)
    along += phase[:, None, None]
    return (
        np.concatenate([np.sin(along), np.cos(along)]),
        weight / np.sqrt(0.5 * np.sum(weight**2)),
        pace,
    )
