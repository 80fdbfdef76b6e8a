"""Images of the twin's instrument in a posture, with exact truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.loop.construction import build_feature_model
from tautscope.loop.state_prediction import StatePrediction
from tautscope.twin.camera import TwinCamera

CONFIG = Config()
MODEL = build_feature_model(CONFIG)
DEVIATION = np.array([2e-3, 0.15, 0.12])


@dataclass(frozen=True)
class Scene:
    """A posture, its image and the true features."""

    state: NDArray[np.float64]
    image: NDArray[np.uint8]
    truth: NDArray[np.float64]

    def expectation(self, seed: int | None = None) -> StatePrediction:
        """Of the posture; with a seed, off by as much as it says it may be."""
        off = 0.0 if seed is None else np.random.default_rng(seed).normal(0.0, DEVIATION)
        return StatePrediction(self.state + off, DEVIATION)

    def outline(self, band: int) -> NDArray[np.float64]:
        """Of the band in the image, by the model (n, 2) [px]."""
        bands = MODEL.bands(self.state)
        assert bands is not None
        return bands[band][3]


def centreline(state: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points and tangents of a straight shaft, an arc and a straight tip in the guide's frame."""
    insertion, rotation, bending = state
    length, tip = CONFIG.instrument.bending_length, CONFIG.instrument.tip_length
    angle = bending * np.linspace(0, 1, 21)
    chord = length * np.linspace(0, 1, 21) * np.sinc(angle / 2 / np.pi)
    across = np.array([np.cos(rotation), np.sin(rotation), 0.0])
    along = np.array([0.0, 0.0, 1.0])
    arc = np.outer(np.sin(angle / 2) * chord, across)
    arc += np.outer(insertion + np.cos(angle / 2) * chord, along)
    heading = np.outer(np.sin(angle), across) + np.outer(np.cos(angle), along)
    points = np.vstack([np.zeros(3), arc, arc[-1] + tip * heading[-1]])
    return points, np.vstack([along, heading, heading[-1]])


def scenes(count: int, seed: int, background: str | None = None) -> list[Scene]:
    """Postures in which both bands are wholly visible, over mucosa or real frames."""
    rng = np.random.default_rng(seed)
    camera = TwinCamera(CONFIG.replace(**{"twin.seed": seed, "twin.background": background}))
    found: list[Scene] = []
    while len(found) < count:
        state = rng.uniform([0.012, -2.0, 0.0], [0.040, 2.0, 1.5])
        rendered = camera.draw(*centreline(state), 25 * len(found))
        bands = MODEL.bands(state)
        if bands is None or not (rendered.true_visible > 0.97).all():
            continue
        whole = np.concatenate([band[1] for band in bands])
        corners = np.vstack([band[3] for band in bands])
        inside = (corners > 8).all() and (corners < [711, 567]).all()
        if inside and abs(whole - rendered.true_features).max() < 0.5:
            found.append(Scene(state, rendered.image, rendered.true_features))
    return found


def cut_scenes(count: int, seed: int) -> list[Scene]:
    """Postures in which the border of the image leaves little more than half of a band."""
    rng = np.random.default_rng(seed)
    camera = TwinCamera(CONFIG.replace(**{"twin.seed": seed}))
    found: list[Scene] = []
    while len(found) < count:
        # Bent up, so that the bands come to lie at the upper border.
        state = rng.uniform([0.010, -2.0, 1.4], [0.020, -1.3, 1.75])
        rendered = camera.draw(*centreline(state), 25 * len(found))
        if 0.52 < rendered.true_visible.min() < 0.62:
            found.append(Scene(state, rendered.image, rendered.true_features))
    return found
