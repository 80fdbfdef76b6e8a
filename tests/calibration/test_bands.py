"""The bands' colour from motion, clicks and masks; the drawn scene is the ground truth."""

import cv2
import numpy as np
import pytest
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from tautscope.calibration.bands import labels, motion, result
from tautscope.calibration.bands.labels import (
    BACKGROUND,
    BAND_A,
    BAND_B,
    from_mask,
    label_clicks,
    labelled,
)
from tautscope.calibration.bands.motion import find_moving_bands
from tautscope.calibration.bands.result import fit_colour
from tautscope.errors import CalibrationError, FieldError

GREEN, GREY, DARK, TISSUE = (40, 120, 35), (110, 112, 114), (25, 24, 26), (95, 110, 190)
HEIGHT, WIDTH = 240, 320
TIMES = np.arange(30) * 0.3


def scene(
    shift: float, seed: int, band: tuple[int, int, int] = GREEN
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """Tissue, and an instrument with two bands that enters from below, moved by a shift [px].

    Returns:
        The image, and the masks of the bands.
    """
    texture = np.random.default_rng(1).normal(0, 12, (HEIGHT // 8, WIDTH // 8, 3))
    image = np.array(TISSUE) + cv2.resize(texture, (WIDTH, HEIGHT), interpolation=cv2.INTER_CUBIC)
    u = np.arange(WIDTH)[None, :] + np.zeros((HEIGHT, 1))
    v = np.arange(HEIGHT)[:, None] + np.zeros((1, WIDTH))
    along, across = HEIGHT - v - shift, np.abs(u - 150 - 0.2 * shift)
    shaft = (across < 12) & (along < 60)
    tip = (across < 10) & (along >= 60) & (along < 140)
    bands = [(across < 10) & (along >= a) & (along < a + 18) for a in (72, 118)]
    image[shaft], image[tip] = DARK, GREY
    for mask in bands:
        image[mask] = band
    image = cv2.GaussianBlur(image, (0, 0), 0.8)
    image += np.random.default_rng([7, seed]).normal(0, 3, image.shape)
    first, second = (mask.astype(np.uint8) for mask in bands)
    return np.clip(image, 0, 255).astype(np.uint8), (first, second)


def sweep(band: tuple[int, int, int] = GREEN) -> tuple[list[np.ndarray], np.ndarray]:
    """Images of a sine of insertion that lags its motor, and the positions of the motors."""
    phase = 2 * np.pi * TIMES / 9
    positions = np.column_stack([0.02 * np.sin(phase), 0 * phase, 0 * phase])
    return [scene(30 + 30 * np.sin(p - 0.4), k, band)[0] for k, p in enumerate(phase)], positions


def truth(k: int) -> tuple[np.ndarray, np.ndarray]:
    return scene(30 + 30 * np.sin(2 * np.pi * TIMES[k] / 9 - 0.4), k)[1]


def test_bands_are_found_by_their_motion() -> None:
    images, positions = sweep()
    found = find_moving_bands(images, TIMES, positions)
    assert len(found) > 25
    for k, each in enumerate(found[:10]):
        bands = np.maximum(*truth(k))
        is_band = (each.labels == BAND_A) | (each.labels == BAND_B)
        assert bands[is_band].mean() > 0.98
        assert is_band[bands > 0].mean() > 0.5
        assert bands[each.labels == BACKGROUND].mean() < 1e-3
    fit = fit_colour(found)
    assert min(fit.hits) > 0.98
    assert fit.errors < 0.005
    assert fit.separation > 5


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ("still", "Hardly anything in the images moves"),
        ("unplugged", "motors did not move"),
        ("shuffled", "motors explain only"),
        ("grey bands", "No colour of the moving pixels"),
        ("like tissue", "No colour of the moving pixels"),
        ("flicker", "of the image changes"),
    ],
)
def test_a_sweep_without_an_answer_is_refused(change: str, named: str) -> None:
    bands = {"grey bands": GREY, "like tissue": TISSUE}
    images, positions = sweep(bands.get(change, GREEN))
    random = np.random.default_rng(3)
    if change == "still":
        images = [scene(30, k)[0] for k in range(len(TIMES))]
    elif change == "unplugged":
        positions[:] = positions[0]
    elif change == "shuffled":
        positions = random.permutation(positions)
    elif change == "flicker":
        patterns = random.integers(-60, 60, (len(images), HEIGHT // 40, WIDTH // 40, 3))
        large = [cv2.resize(p.astype(np.float32), (WIDTH, HEIGHT)) for p in patterns]
        images = [
            np.clip(image + p, 0, 255).astype(np.uint8)
            for image, p in zip(images, large, strict=True)
        ]
    with pytest.raises(CalibrationError, match=named):
        find_moving_bands(images, TIMES, positions)


def test_few_random_positions_do_not_follow_three_motors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of white noise, no more than 1 in 50 looks like motion of the motors."""
    count = motion.LEAST_IMAGES
    times = np.arange(count) * motion.DURATION / count
    phases = 2 * np.pi * times[:, None] / motion.DURATION * [1, 1, 2] + [0, 1, 0]
    regressors = motion._regressors(times, np.sin(phases))
    random, followed = np.random.default_rng(5), 0
    monkeypatch.setattr(labels, "two_bands", lambda *_: ((), ()))
    monkeypatch.setattr(labels, "centroid", lambda _: random.normal(0, 10, 2))
    for _ in range(200):
        found = motion._evaluate(np.zeros(count), (0, 0, 0), 0, regressors)
        followed += found.following > motion.LEAST_FOLLOWING
    assert followed <= 4


def test_no_more_pixels_are_used_than_said(monkeypatch: pytest.MonkeyPatch) -> None:
    images, _ = sweep()
    monkeypatch.setattr(motion, "_MOST_PIXELS", 10_000)
    own, tissue = motion._split(images)
    assert 5000 < len(own) <= 10_000
    assert 25_000 < len(tissue) <= 50_000
    image, bands = scene(30, 0)
    each = labelled(image, bands)
    most = len(each.pixels(BAND_A)) - 1
    monkeypatch.setattr(result, "_MOST_PIXELS", most)
    assert len(result._of([each], BAND_A)) <= most


def test_malformed_input_is_refused() -> None:
    images, positions = sweep()
    with pytest.raises(FieldError, match="images"):
        find_moving_bands(images[:5], TIMES[:5], positions[:5])
    with pytest.raises(FieldError, match="positions"):
        find_moving_bands(images, TIMES, positions[:-1])
    with pytest.raises(FieldError, match="times"):
        find_moving_bands(images, TIMES[:-1], positions)
    with pytest.raises(FieldError, match=r"^times: got"):
        find_moving_bands(images, ["a"], positions)


def test_bands_grow_from_clicks() -> None:
    image, bands = scene(30, 0)
    clicks = [tuple(int(c) for c in np.argwhere(mask).mean(axis=0)[::-1]) for mask in bands]
    each = label_clicks(image, clicks)
    for label, mask in zip((BAND_A, BAND_B), bands, strict=True):
        own = each.labels == label
        assert mask[own].mean() > 0.99
        assert own[mask > 0].mean() > 0.5
    fit = fit_colour([each])
    assert min(fit.hits) > 0.98
    assert fit.errors < 0.01


def test_a_band_of_a_similar_colour_does_not_run_into_the_instrument() -> None:
    # Each channel differs from the grey of the tip by less than the largest tolerance.
    image, bands = scene(30, 0, (70, 140, 70))
    clicks = [tuple(int(c) for c in np.argwhere(mask).mean(axis=0)[::-1]) for mask in bands]
    each = label_clicks(image, clicks)
    assert bands[0][each.labels == BAND_A].mean() > 0.95
    assert bands[1][each.labels == BAND_B].mean() > 0.95


@pytest.mark.parametrize(
    ("clicks", "kind", "named"),
    [
        ([(10, 10)], FieldError, "two"),
        ([(10, 10), (400, 10)], FieldError, "320 x 240"),
        ([(156, 130), (157, 131)], CalibrationError, "on one region"),
        ([(10, 10), (300, 20)], CalibrationError, "cannot be told"),
    ],
)
def test_bad_clicks_are_refused(
    clicks: list[tuple[int, int]], kind: type[Exception], named: str
) -> None:
    image, _ = scene(30, 0)
    with pytest.raises(kind, match=named):
        fit_colour([label_clicks(image, clicks)])


def test_the_band_that_cannot_be_told_is_named() -> None:
    image, (first, second) = scene(30, 0)
    patch = np.zeros_like(second)
    patch[20:28, 20:28] = 1  # tissue, and so few pixels that they do not change the fit
    assert not (second & patch).any()
    with pytest.raises(CalibrationError, match=r"the second band .* of its pixels"):
        fit_colour([labelled(image, (first, patch))])


@pytest.mark.parametrize(
    ("first", "second", "named"),
    [(GREEN, TISSUE, "second band|everything|rest"), (TISSUE, TISSUE, "cannot be told")],
)
def test_a_band_like_the_tissue_is_named(
    first: tuple[int, int, int], second: tuple[int, int, int], named: str
) -> None:
    image, bands = scene(30, 0, first)
    image = image.astype(float)
    if second != first:
        inner = bands[1] > 0
        image[inner] = second + np.random.default_rng(5).normal(0, 8, (int(inner.sum()), 3))
    each = labelled(np.clip(image, 0, 255).astype(np.uint8), bands)
    with pytest.raises(CalibrationError, match=named):
        fit_colour([each])


def test_the_discriminant_is_that_of_scikit_learn() -> None:
    image, bands = scene(30, 0)
    mask = np.full(image.shape[:2], 0, np.uint8)
    mask[(bands[0] | bands[1]) > 0] = 255
    each = from_mask(image, mask)
    fit = fit_colour([each])
    pixels = np.concatenate([each.pixels(BAND_A), each.pixels(BACKGROUND)]).astype(float)
    names = np.repeat([1, 0], [len(each.pixels(BAND_A)), len(each.pixels(BACKGROUND))])
    # Equal priors weigh the covariances of both classes alike.
    model = LinearDiscriminantAnalysis(solver="lsqr", priors=[0.5, 0.5]).fit(pixels, names)
    expected = model.coef_[0] / np.abs(model.coef_).max()
    assert fit.weights == pytest.approx(expected, rel=0.02, abs=0.02)


def test_overexposed_pixels_are_ignored() -> None:
    image, bands = scene(30, 0)
    image[bands[0] > 0] = 255
    each = labelled(image, bands)
    assert not (each.labels == BAND_A).any()
    assert (each.labels == BAND_B).any()
    image[bands[1] > 0] = 255
    with pytest.raises(CalibrationError, match="overexposed"):
        fit_colour([labelled(image, bands)])
