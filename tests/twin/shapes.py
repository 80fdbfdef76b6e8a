"""Shapes of an instrument to draw, and a camera to draw them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.twin.camera import TwinCamera

Array = NDArray[Any]


Frames = tuple[Array, Array]


QUIET = {"twin.image_noise": 0.0}


NOTHING = (np.full((2, 3), np.nan), np.zeros((2, 3)))


def make(**changes: Any) -> tuple[Config, TwinCamera]:
    config = Config().replace(**changes)
    return config, TwinCamera(config)


def bent(config: Config, insertion: float, rotation: float, bending: float) -> Frames:
    """Frames of a straight shaft, an arc and a straight tip in the guide's frame."""
    instrument = config.instrument
    angle = bending * np.linspace(0, 1, 21)
    along = instrument.bending_length * np.linspace(0, 1, 21)
    half = angle / 2
    chord = along * np.sinc(half / np.pi)
    axis = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    place = np.stack([chord * np.sin(half), 0 * half, insertion + chord * np.cos(half)], axis=1)
    place = np.vstack([[0, 0, 0], place, place[-1] + instrument.tip_length * axis[-1]])
    axis = np.vstack([[0, 0, 1], axis, axis[-1]])
    cos, sin = np.cos(rotation), np.sin(rotation)
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    return place @ turn.T, axis @ turn.T
