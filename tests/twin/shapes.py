"""Centrelines of an instrument, and a camera to render them."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.twin.camera import TwinCamera

Array = NDArray[Any]
Centreline = tuple[Array, Array]

QUIET = {"twin.image_noise": 0.0}
NO_INSTRUMENT = (np.full((2, 3), np.nan), np.zeros((2, 3)))


def make(**changes: Any) -> tuple[Config, TwinCamera]:
    config = Config().replace(**changes)
    return config, TwinCamera(config)


def bent(config: Config, insertion: float, rotation: float, bending: float) -> Centreline:
    """Points and tangents of a straight shaft, an arc and a straight tip in the guide's frame."""
    instrument = config.instrument
    angle = bending * np.linspace(0, 1, 21)
    along = instrument.bending_length * np.linspace(0, 1, 21)
    half = angle / 2
    chord = along * np.sinc(half / np.pi)
    tangents = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    points = np.stack([chord * np.sin(half), 0 * half, insertion + chord * np.cos(half)], axis=1)
    points = np.vstack([[0, 0, 0], points, points[-1] + instrument.tip_length * tangents[-1]])
    tangents = np.vstack([[0, 0, 1], tangents, tangents[-1]])
    cos, sin = np.cos(rotation), np.sin(rotation)
    rotate = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return points @ rotate.T, tangents @ rotate.T
