"""Bands are found in a single image of which no posture is known."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scenes import CONFIG, Scene, cut_scenes, scenes
from tautscope.loop.vision import MarkerDetector

Image = NDArray[np.uint8]

SCENES = scenes(8, seed=5)
CUT = cut_scenes(12, seed=9)
DETECTOR = MarkerDetector(CONFIG)
TOUCHING = [
    scene for scene in scenes(120, seed=3) if np.hypot(*(scene.truth[2:] - scene.truth[:2])) < 16
]
GREEN = (70, 190, 60)
DEBRIS = (60, 90, 120)


def error(features: NDArray[np.float64], scene: Scene) -> float:
    """Distance of the worse band from the truth [px]."""
    return float(np.hypot(*(features - scene.truth).reshape(2, 2).T).max())


def write_letters(image: Image, avoid: NDArray[np.float64], seed: int) -> None:
    """Write green words at random places farther than 120 px from the points to avoid."""
    rng = np.random.default_rng(seed)
    words = 0
    while words < 6:
        u, v = rng.uniform([20, 40], [600, 560])
        if all(np.hypot(u + 40 - a, v - 8 - b) > 120 for a, b in avoid.reshape(-1, 2)):
            at = (round(u), round(v))
            cv2.putText(image, "biopsy", at, cv2.FONT_HERSHEY_SIMPLEX, 0.8, GREEN, 2)
            words += 1


@pytest.mark.parametrize("number", range(len(SCENES)))
def test_bands_are_found_among_letters_of_their_colour(number: int) -> None:
    scene = SCENES[number]
    image = scene.image.copy()
    write_letters(image, scene.truth, seed=number)
    detection = DETECTOR.detect(image)
    assert detection.valid, (scene.state, detection.reason)
    assert error(detection.features, scene) < 1.2


@pytest.mark.parametrize("number", range(len(SCENES)))
def test_letters_alone_are_no_bands(number: int) -> None:
    empty = scenes(1, seed=number)[0]
    tissue = np.full_like(empty.image, (60, 70, 140))
    write_letters(tissue, np.empty(0), seed=100 + number)
    assert not any(DETECTOR.detect(tissue).found)


@pytest.mark.parametrize("number", range(len(CUT)))
def test_a_band_cut_by_the_border_is_found_whole(number: int) -> None:
    scene = CUT[number]
    detection = DETECTOR.detect(scene.image)
    assert detection.valid, (scene.state, detection.reason)
    assert error(detection.features, scene) < 1.5


@pytest.mark.parametrize("number", range(len(SCENES)))
@pytest.mark.parametrize("band", [0, 1])
def test_a_band_with_a_covered_corner_is_found_whole(number: int, band: int) -> None:
    scene = SCENES[number]
    outline = scene.outline(band)
    corner, opposite = outline[0], outline[len(outline) // 2]
    image = scene.image.copy()
    radius = round(0.4 * float(np.hypot(*(opposite - corner))))
    cv2.circle(image, np.rint(corner).astype(int), radius, DEBRIS, cv2.FILLED)
    detection = DETECTOR.detect(image)
    assert detection.valid, (scene.state, detection.reason)
    assert error(detection.features, scene) < 2.5


@pytest.mark.parametrize("number", range(len(TOUCHING)))
def test_touching_bands_that_blur_has_merged_are_found(number: int) -> None:
    scene = TOUCHING[number]
    image = np.asarray(cv2.GaussianBlur(scene.image, (0, 0), 3.0), dtype=np.uint8)
    noise = np.random.default_rng(number).normal(0, 1.5, image.shape)
    image = np.clip(np.rint(image + noise), 0, 255).astype(np.uint8)
    for detection in (DETECTOR.detect(image), DETECTOR.detect(image, None, scene.expectation(7))):
        assert detection.valid, (scene.state, detection.reason)
        assert error(detection.features, scene) < 1.5
