"""Connected components against SciPy and OpenCV."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage
from tautscope._core import label_regions


def by_scipy(mask: NDArray[np.bool_]) -> list[tuple[float, ...]]:
    labels, count = ndimage.label(mask, structure=np.ones((3, 3)))
    boxes = ndimage.find_objects(labels)
    regions = []
    for label, (rows, columns) in zip(range(1, count + 1), boxes, strict=True):
        v, u = np.nonzero(labels == label)
        width, height = columns.stop - columns.start, rows.stop - rows.start
        centroid = (int(u.sum()) / len(u), int(v.sum()) / len(v))
        regions.append((len(u), *centroid, columns.start, rows.start, width, height))
    return sorted(regions)


def by_opencv(mask: NDArray[np.bool_]) -> list[tuple[float, ...]]:
    _, _, stats, centroids = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    return sorted(
        (area, u, v, *box)
        for (*box, area), (u, v) in zip(stats[1:].tolist(), centroids[1:].tolist(), strict=True)
    )


def ours(mask: NDArray[np.bool_]) -> list[tuple[float, ...]]:
    return sorted((area, *centroid, *box) for centroid, area, box in label_regions(mask))


SIZES = [(1, 1), (1, 2), (1, 97), (97, 1), (2, 2), (3, 5), (31, 32), (32, 33), (33, 64), (65, 96)]


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("density", [0.02, 0.1, 0.3, 0.4, 0.5, 0.7, 0.95])
def test_random_masks(size: tuple[int, int], density: float) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        mask = rng.random(size) < density
        assert ours(mask) == by_scipy(mask) == by_opencv(mask), f"{seed=}"


@pytest.mark.parametrize("sigma", [0.7, 1.5, 4.0])
def test_smooth_masks(sigma: float) -> None:
    for seed in range(4):
        noise = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(90, 130)), sigma)
        mask = noise > 0
        assert ours(mask) == by_scipy(mask) == by_opencv(mask), f"{seed=}"


@pytest.mark.parametrize("size", SIZES, ids=str)
def test_regular_masks(size: tuple[int, int]) -> None:
    v, u = np.indices(size)
    spiral = np.maximum(abs(u - size[1] // 2), abs(v - size[0] // 2)) % 2 == 0
    comb = (v == size[0] - 1) | (u % 2 == 0)
    tilted = (u + v) % 3 == 0
    for mask in (
        u < 0,
        u >= 0,
        (u + v) % 2 == 0,
        (u % 2 == 0) & (v % 2 == 0),
        spiral,
        comb,
        tilted,
    ):
        assert ours(mask) == by_scipy(mask) == by_opencv(mask)
        assert ours(mask[::-1]) == by_scipy(mask[::-1])
        assert ours(mask.T) == by_scipy(mask.T)


def test_regions_come_in_the_order_of_their_last_rows() -> None:
    mask = np.array([[1, 0, 0, 1, 0, 0], [1, 0, 0, 0, 0, 1], [1, 0, 1, 0, 0, 0]], dtype=bool)
    assert [box[:2] for _, _, box in label_regions(mask)] == [(3, 0), (5, 1), (0, 0), (2, 2)]


def test_a_mask_without_pixels_has_no_regions() -> None:
    for size in ((0, 0), (0, 5), (5, 0)):
        assert label_regions(np.zeros(size, dtype=bool)) == []
