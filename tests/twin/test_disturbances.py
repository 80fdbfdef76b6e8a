"""Image disturbances of the twin: seeded, smooth, of the stated strength, with correct truth."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from conditions import frames as frames_of
from numpy.typing import NDArray
from tautscope.config import DISTURBANCES, Config
from tautscope.loop.rig import Frame
from tautscope.twin import Twin, obstacles, optics
from tautscope.twin.bands import Bands
from tautscope.twin.camera import RenderedImage, TwinCamera
from tautscope.twin.disturbances import NO_INSTRUMENT, TABLE
from tautscope.twin.noise import TemporalNoise

Array = NDArray[Any]

STATE = np.array([22e-3, 0.3, 0.9])
QUIET = {"twin.image_noise": 0.0}
SMALL = {
    "camera.width": 360,
    "camera.height": 288,
    "camera.fx": 212.0,
    "camera.fy": 227.0,
    "camera.cx": 174.8,
    "camera.cy": 142.5,
}
"""Half the size of the article's camera, the same view."""
LARGE = {key: getattr(Config().camera, key.removeprefix("camera.")) for key in SMALL}


def camera(*names: str, **changes: Any) -> TwinCamera:
    return TwinCamera(Config().replace(**{**SMALL, "twin.disturb": names, **changes}))


def render(twin_camera: TwinCamera, sequence: int = 0, state: Array = STATE) -> RenderedImage:
    return twin_camera.draw(*frames_of.centreline(Config(), state), sequence)


def level(image: Array) -> Array:
    return image.astype(np.float64)


def test_every_name_has_one_entry() -> None:
    assert sorted([*TABLE, NO_INSTRUMENT]) == sorted(DISTURBANCES)


def test_the_table_follows_the_light_path() -> None:
    stages = [stage for stage, _ in TABLE.values()]
    assert stages == sorted(stages)


@pytest.mark.parametrize("name", DISTURBANCES)
def test_same_seed_same_bytes_in_any_order(name: str) -> None:
    first, again = camera(name), camera(name)
    wanted = [render(first, k) for k in (3, 700, 31)]
    for k, rendered in reversed(list(zip((3, 700, 31), wanted, strict=True))):
        render(again, 5, STATE + 0.1)
        repeated = render(again, k)
        np.testing.assert_array_equal(repeated.image, rendered.image)
        np.testing.assert_array_equal(repeated.true_features, rendered.true_features)
        np.testing.assert_array_equal(repeated.true_visible, rendered.true_visible)


@pytest.mark.parametrize("name", DISTURBANCES)
def test_disturbances_change_the_image_and_not_the_true_features(name: str) -> None:
    clean, disturbed = camera(), camera(name)
    changed = 0
    for k in range(0, 200, 40):
        one, other = render(clean, k), render(disturbed, k)
        changed += bool((one.image != other.image).any())
        assert (other.true_visible <= one.true_visible + 1e-9).all()
        there = np.repeat(other.true_visible > 0, 2)
        np.testing.assert_allclose(other.true_features[there], one.true_features[there], rtol=1e-12)
    assert changed >= 3, f"{name} changed {changed} of 5 images"


@pytest.mark.parametrize("name", [name for name in DISTURBANCES if name != NO_INSTRUMENT])
def test_disturbances_depend_on_the_seed(name: str, tmp_path: Path) -> None:
    grey = np.full((288, 360, 3), 120, np.uint8)
    grey[::2, ::2] = 60
    cv2.imwrite(str(tmp_path / "same.png"), grey)
    same = {**QUIET, "twin.background": str(tmp_path)}
    one, other = (camera(name, **same, **{"twin.seed": seed}) for seed in (0, 1))
    differ = [(render(one, k).image != render(other, k).image).any() for k in range(0, 300, 60)]
    assert sum(differ) >= 3


@pytest.mark.parametrize("name", [name for name in TABLE if name != "text"])
def test_disturbances_vary_smoothly_over_frames(name: str) -> None:
    twin_camera = camera(name, **QUIET)
    images = [level(render(twin_camera, k).image) for k in range(45)]
    steps = [np.abs(b - a).mean() for a, b in pairwise(images)]
    span = max(np.abs(image - images[0]).mean() for image in images)
    assert span > 0
    assert max(steps) < 0.3 * span, f"a step of {max(steps)} in a span of {span}"


def test_temporal_noise_is_smooth_and_covers_its_range() -> None:
    values = np.array([TemporalNoise(3, "exposure", k).scalar("gain") for k in range(4000)])
    assert values.min() == -1 and values.max() == 1
    assert np.abs(np.diff(values)).max() < 0.12
    assert abs(values.mean()) < 0.15
    levels = np.array([TemporalNoise(3, "debris", k).episode("lump")[1] for k in range(500)])
    assert levels.min() < 0.01 and levels.max() == 1
    assert np.abs(np.diff(levels)).max() < 0.12


def test_debris_hides_up_to_forty_percent_of_a_band() -> None:
    twin_camera = camera("debris")
    shares = []
    for k in range(0, 3000, 12):
        rendered = render(twin_camera, k)
        shares.append(1 - rendered.true_visible)
    assert np.max(shares) < obstacles.MAX_DEBRIS_SHARE + 0.02
    assert np.max(shares) > 0.33
    assert (np.max(shares, axis=0) > 0.25).all(), "both bands are met"


def test_the_visible_share_matches_the_changed_pixels() -> None:
    # `true_visible` is compared with the share of the band's green pixels that remains.
    clean, twin_camera = camera(**QUIET, **LARGE), camera("debris", **QUIET, **LARGE)
    state = np.array([15e-3, -0.5, 0.3])

    def is_green(image: Array) -> Array:
        blue, green_level, red = np.moveaxis(level(image), 2, 0)
        return np.asarray((green_level > 1.35 * red) & (green_level > 1.35 * blue))

    undisturbed = render(clean, 0, state)
    centroids = undisturbed.true_features.reshape(2, 2)
    rows, columns = np.nonzero(is_green(undisturbed.image))
    nearest = np.linalg.norm(np.stack([columns, rows], 1)[:, None] - centroids, axis=-1).argmin(1)
    compared = 0
    for k in range(5, 420, 30):
        rendered = render(twin_camera, k, state)
        remaining = is_green(rendered.image)[rows, columns]
        for band in (0, 1):
            share = remaining[nearest == band].mean()
            assert share == pytest.approx(rendered.true_visible[band], abs=0.04), (k, band)
            compared += share < 0.9
    assert compared >= 3


def test_a_band_behind_the_field_stop_is_dark_and_hidden() -> None:
    twin_camera = camera("partial", **QUIET)
    shares = []
    for k in range(0, 900, 30):
        rendered = render(twin_camera, k)
        shares.append(rendered.true_visible.min())
        if shares[-1] < 0.99:
            assert (rendered.image.max(axis=2) == 0).any()
    assert 1 - min(shares) < optics.MAX_STOPPED_SHARE + 0.02
    assert 1 - min(shares) > 0.3


def test_exposure_is_a_factor_between_a_quarter_and_four_and_clips() -> None:
    clean, twin_camera = level(render(camera(**QUIET)).image), camera("exposure", **QUIET)
    factors = []
    for k in range(0, 1500, 25):
        image = level(render(twin_camera, k).image)
        unsaturated = (image > 5) & (image < 250) & (clean > 20)
        factor = np.median(image[unsaturated] / clean[unsaturated])
        np.testing.assert_allclose(image, np.clip(factor * clean, 0, 255), atol=0.03 * 255)
        factors.append(factor)
    assert min(factors) == pytest.approx(0.25, rel=0.05)
    assert max(factors) == pytest.approx(4, rel=0.05)


def test_white_balance_is_one_gain_per_channel() -> None:
    clean, twin_camera = level(render(camera(**QUIET)).image), camera("white_balance", **QUIET)
    gains = []
    for k in range(0, 1500, 50):
        image = level(render(twin_camera, k).image)
        unsaturated = (clean > 40) & (clean < 190)
        gains.append(
            [
                np.median(image[..., c][unsaturated[..., c]] / clean[..., c][unsaturated[..., c]])
                for c in range(3)
            ]
        )
        np.testing.assert_allclose(image, np.clip(clean * gains[-1], 0, 255), atol=2.5)
    assert np.min(gains) == pytest.approx(0.8, rel=0.02)
    assert np.max(gains) == pytest.approx(1.25, rel=0.02)


@pytest.mark.parametrize("name", ["motion_blur", "touching"])
def test_blur_preserves_centroid_and_intensity(name: str) -> None:
    spot = np.zeros((61, 81, 3), np.float32)
    spot[30, 40] = 1000
    nothing = Bands.from_surface(np.empty((0, 5)))
    _, apply = TABLE[name]
    widest = 0.0
    y, x = np.mgrid[:61, :81]
    for k in range(0, 900, 10):
        light, hidden = apply(spot.copy(), nothing, TemporalNoise(2, name, k))
        weight = light[..., 0].astype(float)
        assert hidden is None
        assert weight.sum() == pytest.approx(1000, rel=1e-4)
        assert (weight * x).sum() / 1000 == pytest.approx(40, abs=1e-3)
        assert (weight * y).sum() / 1000 == pytest.approx(30, abs=1e-3)
        second = ((weight * ((x - 40) ** 2 + (y - 30) ** 2)).sum()) / 1000
        widest = max(widest, second)
    # A line of length l has the second moment l^2 / 12, a Gaussian 2 sigma^2.
    expected = optics.MAX_BLUR**2 / 12 if name == "motion_blur" else 50.0
    assert widest == pytest.approx(expected, rel=0.15)


def test_smoke_reduces_contrast() -> None:
    clean, twin_camera = level(render(camera(**QUIET)).image), camera("smoke", **QUIET)
    ratio = [level(render(twin_camera, k).image).std() / clean.std() for k in range(0, 900, 30)]
    assert min(ratio) < 0.6
    assert max(ratio) == pytest.approx(1, abs=0.1)


def test_highlights_are_saturated_and_lie_on_the_bands() -> None:
    clean, twin_camera = camera(**QUIET), camera("highlights", **QUIET)
    before = level(render(clean, 0).image)
    centroids = render(clean, 0).true_features.reshape(2, 2)
    largest_count = 0
    for k in range(0, 300, 15):
        image = level(render(twin_camera, k).image)
        white = (image.min(axis=2) > 250) & (before.min(axis=2) < 200)
        rows, columns = np.nonzero(white)
        distances = np.linalg.norm(np.stack([columns, rows], 1)[:, None] - centroids, axis=-1).min(
            1
        )
        assert distances.size == 0 or distances.max() < 60
        largest_count = max(largest_count, white.sum())
    assert largest_count > 30


def test_overlays_have_no_noise_and_the_tissue_does() -> None:
    one, other = (render(camera("inset", **{"twin.image_noise": 3.0}), k).image for k in (100, 101))
    assert (one[230:235, 10:30] == one[230, 10]).all()
    assert (one[:100] != other[:100]).mean() > 0.5


def test_a_band_under_the_inset_has_no_features() -> None:
    u, v = render(camera()).true_features[2:].tolist()
    # The view is shifted so that band B is in the middle of the inset.
    shift = {
        "camera.cx": SMALL["camera.cx"] + 0.16 * 360 - u,
        "camera.cy": SMALL["camera.cy"] + 0.83 * 288 - v,
    }
    assert render(camera(**shift)).true_visible[1] > 0.9
    hidden = render(camera("inset", **shift))
    assert hidden.true_visible[1] == 0
    assert np.isnan(hidden.true_features[2:]).all()


def test_no_instrument_is_empty() -> None:
    rendered = render(camera("no_instrument", **QUIET))
    assert np.isnan(rendered.true_features).all()
    assert (rendered.true_visible == 0).all()
    nothing = camera(**QUIET).draw(np.full((2, 3), np.nan), np.zeros((2, 3)), 0)
    np.testing.assert_array_equal(rendered.image, nothing.image)


def test_all_disturbances_together_at_any_pose_and_size() -> None:
    rng = np.random.default_rng(4)
    names = [name for name in DISTURBANCES if name != NO_INSTRUMENT]
    for size in [(720, 576), (64, 48), (1, 1)]:
        twin_camera = camera(*names, **{"camera.width": size[0], "camera.height": size[1]})
        for k in range(12):
            state = rng.uniform([0, -4, -2.5], [60e-3, 4, 2.5])
            rendered = render(twin_camera, int(rng.integers(2**40)), state)
            assert rendered.image.shape == (size[1], size[0], 3)
            assert rendered.image.dtype == np.uint8
            assert ((rendered.true_visible >= 0) & (rendered.true_visible <= 1)).all(), (
                f"{size} {k}"
            )
            known = np.isfinite(rendered.true_features)
            np.testing.assert_array_equal(known, np.repeat(rendered.true_visible > 0, 2))


def test_frames_of_the_twin_carry_the_visible_share() -> None:
    config = Config().replace(**{"twin.disturb": ("debris",), "twin.latency_jitter": 0.0})
    twin = Twin(config)
    frames: list[Frame] = []
    sample = twin.reset()
    for _ in range(40):
        sample = twin.step(np.array([25e-3, 0.0, 0.9]))
        frames += [sample.frame] if sample.frame is not None else []
    assert frames
    for frame in frames:
        assert frame.true_visible is not None and frame.true_visible.shape == (2,)
        assert ((frame.true_visible >= 0) & (frame.true_visible <= 1)).all()
