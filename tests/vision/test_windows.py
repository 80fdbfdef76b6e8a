"""Windows see what the whole frame sees, and real frames what the simplest code sees."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.loop.vision import MarkerDetector

Frames = dict[str, tuple[NDArray[np.uint8], NDArray[np.bool_]]]


def simplest(image: NDArray[np.uint8], config: Config) -> NDArray[np.bool_]:
    """What crates/vision documents, whole arrays at a time, nothing skipped."""
    weights = np.array(config.vision.weights)
    scale = 8190 / (255 * max(weights.clip(0).sum(), -weights.clip(max=0).sum()))
    fixed = np.floor(weights * scale * 512 + 0.5)
    values = np.floor((image @ fixed + 256) / 512)
    for _ in range(config.vision.smoothing):
        for axis in (1, 0):
            edges = [(0, 0), (0, 0)]
            edges[axis] = (1, 1)
            padded = np.pad(values, edges, mode="edge")
            n = padded.shape[axis]
            before, here, after = (
                np.take(padded, range(i, n - 2 + i), axis=axis) for i in range(3)
            )
            values = np.floor((before + 2 * here + after + 2) / 4)
    return values > np.floor(config.vision.threshold * scale)


@pytest.mark.parametrize("smoothing", [0, 1, 4])
def test_real_frames_are_decided_as_by_the_simplest_code(
    colon_frames: Frames, smoothing: int
) -> None:
    config = Config().replace(**{"vision.smoothing": smoothing})
    detector = MarkerDetector(config)
    marker = 0
    for name, (image, _) in colon_frames.items():
        mask = detector.mask(image)
        np.testing.assert_array_equal(mask, simplest(image, config), name)
        marker += mask.sum()
    assert marker > 1000


@pytest.mark.parametrize("seed", range(6))
def test_regions_of_a_window_are_those_of_the_mask_there(seed: int) -> None:
    rng = np.random.default_rng(seed)
    height, width = 150, 333
    image = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    image = cv2.GaussianBlur(image, (0, 0), 2)
    settings = {"camera.height": height, "camera.width": width, "vision.minimum_area": 4}
    detector = MarkerDetector(Config().replace(**settings))
    mask = detector.mask(image).astype(np.uint8)
    found = 0
    for _ in range(20):
        left, right = sorted(rng.integers(-20, width + 20, 2).tolist())
        top, bottom = sorted(rng.integers(-20, height + 20, 2).tolist())
        regions = detector.regions_in(image, [(left, top, right, bottom)])
        left, top, right, bottom = (max(0, edge) for edge in (left, top, right, bottom))
        part = mask[top:bottom, left:right]
        if not part.size:
            assert regions == (), f"{seed=}"
            continue
        _, _, stats, centroids = cv2.connectedComponentsWithStats(
            np.ascontiguousarray(part), connectivity=8
        )
        expected = {
            (
                int(area),
                round((u + left) * area),
                round((v + top) * area),
                int(x) + left,
                int(y) + top,
            )
            for (x, y, _, _, area), (u, v) in zip(stats[1:], centroids[1:], strict=True)
            if area >= 4
        }
        seen = {
            (r.area, round(r.centroid[0] * r.area), round(r.centroid[1] * r.area), *r.box[:2])
            for r in regions
        }
        assert len(seen) == min(32, len(expected)), f"{seed=}"
        assert seen <= expected, f"{seed=}"
        found += len(seen)
    assert found > 20


def test_two_windows_are_the_two_together() -> None:
    image = np.zeros((80, 200, 3), np.uint8)
    for u in (40, 150):
        cv2.circle(image, (u, 40), 12, (70, 190, 60), cv2.FILLED)
    config = Config().replace(**{"camera.height": 80, "camera.width": 200})
    detector = MarkerDetector(config)
    both = detector.regions_in(image, [(20, 20, 60, 60), (130, 20, 170, 60)])
    assert {r.centroid for r in both} == {(40.0, 40.0), (150.0, 40.0)}
    assert set(both) == set(detector.detect(image).regions)
    assert detector.regions_in(image, []) == ()
