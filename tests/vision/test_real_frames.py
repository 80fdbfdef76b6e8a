"""The instrument over real mucosa, with the traps that are in it."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scenes import CONFIG, scenes
from tautscope.loop.vision import MarkerDetector

Frames = dict[str, tuple[NDArray[np.uint8], NDArray[np.bool_]]]


@pytest.mark.parametrize("seed", range(3))
def test_bands_are_found(colon_frames: Frames, colon_folder: Path, seed: int) -> None:
    detector = MarkerDetector(CONFIG)
    for number, scene in enumerate(scenes(2 * len(colon_frames), seed, str(colon_folder))):
        known = detector.detect(scene.image, expectation=scene.expectation(number))
        assert known.valid, f"{number}, {seed=}: {known.reason}"
        for detection in (known, detector.detect(scene.image)):
            if detection.valid:
                error = np.hypot(*(detection.features - scene.truth).reshape(2, 2).T).max()
                assert error < 1.5, f"{number}, {seed=}: off by {error} px"


def test_without_the_instrument_nothing_is_found(colon_frames: Frames) -> None:
    detector = MarkerDetector(CONFIG)
    postures = scenes(10, 0)
    for name, (image, _) in colon_frames.items():
        assert not detector.detect(image).valid, name
        for number, scene in enumerate(postures):
            detection = detector.detect(image, expectation=scene.expectation(number))
            assert not any(detection.found), f"{name}, {number}"
