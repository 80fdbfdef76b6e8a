"""Which region is A and which is B."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope.config import CameraConfig, Config, PoseConfig
from tautscope.vision import Detection, MarkerDetector, entry_point

GREEN = (70, 190, 60)
CONFIG = Config().replace(**{"vision.smoothing": 0, "vision.minimum_area": 9})
GATE = CONFIG.vision.gate
A, B = (300, 300), (400, 300)
BAND = 20

Block = tuple[tuple[int, int], int]


def scene(*blocks: Block) -> NDArray[np.uint8]:
    """Green squares of odd side 2 h + 1 around their centres, on mucosa."""
    image = np.full((576, 720, 3), (60, 70, 140), np.uint8)
    for (u, v), half in blocks:
        image[max(v - half, 0) : v + half + 1, max(u - half, 0) : u + half + 1] = GREEN
    return image


def detect(*blocks: Block, predicted: list[float] | None = None) -> Detection:
    return MarkerDetector(CONFIG).detect(scene(*blocks), predicted)


def assert_found(detection: Detection, a: tuple[int, int], b: tuple[int, int]) -> None:
    assert detection.valid, detection.reason
    assert detection.features.tolist() == [*a, *b]


def test_each_band_where_it_is_predicted() -> None:
    assert_found(detect((A, BAND), (B, BAND), predicted=[310, 290, 390, 310]), A, B)
    assert_found(detect((A, BAND), (B, BAND), predicted=[390, 310, 310, 290]), B, A)


def test_bands_of_unequal_size() -> None:
    assert_found(detect((A, BAND), (B, BAND // 2), predicted=[*A, *B]), A, B)
    assert_found(detect((A, BAND // 2), (B, BAND), predicted=[*A, *B]), A, B)


def test_a_speck_on_the_prediction_is_no_band() -> None:
    speck = ((430, 330), 4)
    assert_found(detect((A, BAND), (B, BAND), speck, predicted=[*A, *speck[0]]), A, B)


def test_two_specks_on_the_predictions_are_no_bands() -> None:
    specks = ((330, 340), 3), ((430, 340), 3)
    predicted = [*specks[0][0], *specks[1][0]]
    assert_found(detect((A, BAND), (B, BAND), *specks, predicted=predicted), A, B)


def test_a_large_green_thing_in_reach_is_no_band() -> None:
    inset = ((380, 420), 70)
    assert_found(detect((A, BAND), (B, BAND), inset, predicted=[*A, *B]), A, B)
    assert_found(detect((A, BAND), (B, BAND), inset, predicted=[*B, *A]), B, A)


@pytest.mark.parametrize("seed", range(20))
def test_clutter_out_of_reach_changes_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    clutter = [((int(u), 560), int(half)) for u, half in rng.integers((0, 5), (720, 15), (30, 2))]
    predicted = list(np.array([*A, *B]) + rng.uniform(-40, 40, 4))
    assert_found(detect((A, BAND), (B, BAND), *clutter, predicted=predicted), A, B)


def test_the_gate_is_a_distance() -> None:
    reach = GATE / np.sqrt(2)
    near, far = reach - 0.01, reach + 0.01
    bands = (A, BAND), (B, BAND)
    shifted = lambda s: [A[0] - s, A[1] - s, B[0] + s, B[1] + s]  # noqa: E731
    assert_found(detect(*bands, predicted=shifted(near)), A, B)
    detection = detect(*bands, predicted=shifted(far))
    assert not detection.valid
    assert detection.reason == "no pair within 120 px of the prediction"


def test_one_region_cannot_be_both_bands() -> None:
    detection = detect((A, BAND), ((650, 60), BAND), predicted=[*A, *A])
    assert detection.reason == "no pair within 120 px of the prediction"


def test_regions_of_very_different_size_are_no_pair() -> None:
    detection = detect((A, 2 * BAND), (B, 4), predicted=[*A, *B])
    assert detection.reason == "no pair within 120 px of the prediction"


@pytest.mark.parametrize("predicted", [None, [*A, *B]])
def test_too_few_regions_are_said(predicted: list[float] | None) -> None:
    for blocks, reason in [
        ((), "no region"),
        (((A, BAND),), "one region"),
        (((A, 0),), "no region"),
    ]:
        detection = detect(*blocks, predicted=predicted)
        assert not detection.valid
        assert detection.reason == reason
        assert np.isnan(detection.features).all()
        assert detection.features.shape == (4,)


def test_without_a_prediction_the_two_largest_a_nearer_to_where_the_instrument_enters() -> None:
    entry = np.array(entry_point(CONFIG.camera))
    for seed in range(20):
        rng = np.random.default_rng(seed)
        one, other, speck = (
            tuple(p) for p in (rng.permutation(6)[:3, None] * 100 + 60).repeat(2, 1)
        )
        near, far = sorted((one, other), key=lambda p: float(np.hypot(*(entry - p))))
        blocks = ((one, BAND), (other, BAND + 1), (speck, BAND - 5))
        blocks = tuple(((int(u), int(v * 0.9)), half) for (u, v), half in blocks)
        found = detect(*blocks)
        assert_found(found, (near[0], int(near[1] * 0.9)), (far[0], int(far[1] * 0.9)))


def test_entry_point_is_opencvs_projection_without_distortion() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        x, y, z = (float(value) for value in rng.uniform((-5e-3, -5e-3, 5e-3), 9e-3))
        camera = CameraConfig(camera_from_guide=PoseConfig(translation=(x, y, z)))
        intrinsics = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
        point = np.array([[[x, y, z]]])
        expected, _ = cv2.projectPoints(point, np.zeros(3), np.zeros(3), intrinsics, np.zeros(5))
        np.testing.assert_allclose(
            entry_point(camera), expected.ravel(), rtol=1e-12, err_msg=f"{seed=}"
        )


def test_entry_point_of_a_guide_beside_or_behind_the_camera_keeps_its_direction() -> None:
    for z in (0.0, -8e-3):
        camera = CameraConfig(camera_from_guide=PoseConfig(translation=(3e-3, -4e-3, z)))
        u, v = entry_point(camera)
        assert (u - camera.cx) / camera.fx == pytest.approx(6)
        assert (v - camera.cy) / camera.fy == pytest.approx(-8)
    on_axis = CameraConfig(camera_from_guide=PoseConfig(translation=(0.0, 0.0, -1e-3)))
    assert entry_point(on_axis) == (on_axis.cx, on_axis.cy)
