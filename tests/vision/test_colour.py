"""Fisher's discriminant against scikit-learn's, and on real mucosa."""

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from tautscope.calibration.colour import fit_discriminant
from tautscope.config import Config
from tautscope.errors import FieldError
from tautscope.loop.vision import MarkerDetector


def two_kinds(seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    rng = np.random.default_rng(seed)
    mixing = rng.normal(size=(2, 3, 3)) * 20
    marker = rng.normal(size=(200, 3)) @ mixing[0] + rng.uniform(0, 255, 3)
    background = rng.normal(size=(3000, 3)) @ mixing[1] + rng.uniform(0, 255, 3)
    return marker, background


@pytest.mark.parametrize("seed", range(10))
def test_as_scikit_learn(seed: int) -> None:
    marker, background = two_kinds(seed)
    weights, threshold = fit_discriminant(marker, background)

    pixels = np.concatenate([marker, background])
    kind = np.repeat([1, 0], [len(marker), len(background)])
    oracle = LinearDiscriminantAnalysis(solver="lsqr", priors=[0.5, 0.5]).fit(pixels, kind)

    direction = oracle.coef_[0] / np.abs(oracle.coef_[0]).max()
    np.testing.assert_allclose(weights, direction, rtol=1e-9)
    ours = pixels @ np.array(weights) > threshold
    np.testing.assert_array_equal(ours, oracle.predict(pixels) == 1)


@pytest.mark.parametrize("seed", range(5))
def test_the_scale_is_that_of_grey_levels_and_brightness_scales_the_threshold(seed: int) -> None:
    marker, background = two_kinds(seed)
    weights, threshold = fit_discriminant(marker, background)
    brighter = fit_discriminant(2 * marker, 2 * background)
    assert max(map(abs, weights)) == 1
    np.testing.assert_allclose(brighter[0], weights, rtol=1e-9)
    np.testing.assert_allclose(brighter[1], 2 * threshold, rtol=1e-9)
    swapped = fit_discriminant(background, marker)
    np.testing.assert_allclose([*swapped[0], swapped[1]], [-w for w in (*weights, threshold)])


GOOD = np.random.default_rng(0).normal(size=(50, 3))


@pytest.mark.parametrize(
    ("marker", "background", "field"),
    [
        (np.empty((0, 3)), GOOD, "marker_pixels"),
        (GOOD[:1], GOOD, "marker_pixels"),
        (GOOD, GOOD[:, :2], "background_pixels"),
        (GOOD, GOOD[0], "background_pixels"),
        (GOOD, "red", "background_pixels"),
        (np.where(GOOD > 2, np.nan, GOOD), GOOD, "marker_pixels"),
        (GOOD, GOOD * [1, np.inf, 1], "background_pixels"),
        (GOOD, GOOD, "marker_pixels"),
        (np.full((50, 3), 7.0), np.full((50, 3), 9.0), "marker_pixels"),
        (GOOD * [1, 0, 1], GOOD * [1, 0, 1] + [0, 5, 0], "marker_pixels"),
        (GOOD[:2], GOOD[2:4], "marker_pixels"),
    ],
)
def test_pixels_that_decide_nothing_are_refused(
    marker: object, background: object, field: str
) -> None:
    with pytest.raises(FieldError) as caught:
        fit_discriminant(marker, background)
    assert caught.value.field == field


def test_green_bands_on_real_mucosa(
    colon_frames: dict[str, tuple[NDArray[np.uint8], NDArray[np.bool_]]],
) -> None:
    rng = np.random.default_rng(0)
    shade = rng.uniform(0.3, 1, (20000, 1))
    marker = shade * np.array([70, 190, 60]) + rng.normal(0, 4, (20000, 3))
    background = [image[tissue] for image, tissue in colon_frames.values()]
    weights, threshold = fit_discriminant(marker, np.concatenate(background))
    assert (marker @ np.array(weights) > threshold).mean() > 0.999
    detector = MarkerDetector(
        Config().replace(**{"vision.weights": list(weights), "vision.threshold": threshold})
    )
    for name, (image, tissue) in colon_frames.items():
        assert detector.mask(image)[tissue].mean() < 0.01, name
