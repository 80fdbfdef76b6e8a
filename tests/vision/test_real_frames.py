"""Bands drawn on real mucosa, with the traps that are in it."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.vision import MarkerDetector

Frames = dict[str, tuple[NDArray[np.uint8], NDArray[np.bool_]]]


def draw_band(
    image: NDArray[np.uint8], centre: tuple[float, float], rng: np.random.Generator
) -> NDArray[np.uint8]:
    """A shaded green ellipse with anti-aliased edges, centred to a 16th of a pixel."""
    axes, angle = rng.uniform((30, 20), (55, 35)), float(rng.uniform(0, 180))
    cover = np.zeros(image.shape[:2], np.uint8)
    fixed = [round(16 * value) for value in (*centre, *axes)]
    cv2.ellipse(
        cover, fixed[:2], fixed[2:], angle, 0, 360, 255, cv2.FILLED, lineType=cv2.LINE_AA, shift=4
    )
    u = np.arange(image.shape[1]) - centre[0]
    shade = 1 - 0.6 * np.clip(abs(u) / 60, 0, 1)
    colour = shade[None, :, None] * np.array([70.0, 190.0, 60.0])
    share = cover[..., None] / 255
    drawn = image * (1 - share) + colour * share
    return np.clip(drawn + rng.normal(0, 2, image.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("seed", range(8))
def test_bands_are_found_near_their_predictions(colon_frames: Frames, seed: int) -> None:
    rng = np.random.default_rng(seed)
    detector = MarkerDetector(Config())
    for name, (background, _) in colon_frames.items():
        a = rng.uniform((300, 120), (420, 420))
        b = a + rng.uniform((110, -60), (180, 60))
        drawn = np.round(np.concatenate([a, b]) * 16) / 16
        image = draw_band(draw_band(background, drawn[:2], rng), drawn[2:], rng)
        detection = detector.detect(image, drawn + rng.uniform(-25, 25, 4))
        assert detection.valid, f"{name}, {seed=}: {detection.reason}"
        error = abs(detection.features - drawn).max()
        assert error < 1, f"{name}, {seed=}: off by {error} px"


def test_the_two_largest_regions_fail_on_the_inset(colon_frames: Frames) -> None:
    with_inset = [image for image, tissue in colon_frames.values() if not tissue.all()]
    assert len(with_inset) == 3
    detector = MarkerDetector(Config())
    rng = np.random.default_rng(0)
    for background in with_inset:
        drawn = np.array([400.0, 200.0, 550.0, 200.0])
        image = draw_band(draw_band(background, drawn[:2], rng), drawn[2:], rng)
        assert abs(detector.detect(image).features - drawn).max() > 50
        assert abs(detector.detect(image, drawn).features - drawn).max() < 1
