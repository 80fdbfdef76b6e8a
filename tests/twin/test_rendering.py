"""The rendered image: noise, clipping, sizes, and rejected input."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from shapes import NO_INSTRUMENT, QUIET, Array, bent, make
from tautscope.errors import ConfigError, FieldError
from tautscope.twin.camera import FRAMES_PER_BACKGROUND, TwinCamera


def test_same_seed_same_bytes_in_any_order() -> None:
    config, camera = make()
    frames = bent(config, 20e-3, 0.5, 0.9)
    first = [camera.draw(*frames, k) for k in range(4)]
    again = TwinCamera(config)
    for k in (2, 0, 3, 1):
        again.draw(*bent(config, 30e-3, -1, 0.2), 7)
        rendered = again.draw(*frames, k)
        np.testing.assert_array_equal(rendered.image, first[k].image)
        np.testing.assert_array_equal(rendered.true_features, first[k].true_features)


def test_noise_depends_on_seed_and_frame_number() -> None:
    config, camera = make()
    frames = bent(config, 20e-3, 0.5, 0.9)
    image = camera.draw(*frames, 0).image
    other = TwinCamera(config.replace(**{"twin.seed": 1})).draw(*frames, 0).image
    assert (image != camera.draw(*frames, 1).image).mean() > 0.5
    assert (image != other).mean() > 0.5


@pytest.mark.parametrize("sigma", [0.3, 1.0, 2.0, 7.5])
def test_noise_is_white_and_as_strong_as_configured(sigma: float) -> None:
    config, camera = make(**{"twin.image_noise": sigma})
    clean = TwinCamera(config.replace(**QUIET)).draw(*NO_INSTRUMENT, 0).image.astype(float)
    noise = np.array([camera.draw(*NO_INSTRUMENT, k).image - clean for k in range(2)])
    noise = np.where((clean > 40) & (clean < 215), noise, np.nan)
    assert np.nanstd(noise) == pytest.approx(sigma, rel=0.02)
    assert abs(np.nanmean(noise)) < 0.02 * sigma
    grid = np.nan_to_num(noise)
    pairs = [
        (grid[0], grid[1]),
        (grid[:, 1:], grid[:, :-1]),
        (grid[:, :, 1:], grid[:, :, :-1]),
        (grid[..., 0], grid[..., 1]),
    ]
    for one, other in pairs:
        assert abs((one * other).mean()) < 0.02 * sigma**2


def test_nothing_behind_the_camera_is_drawn() -> None:
    config, camera = make(**QUIET)
    tissue = camera.draw(*NO_INSTRUMENT, 0).image
    frames = bent(config, 20e-3, 0.0, 0.9)
    pose = {"camera.camera_from_guide.translation": (0.0, 0.0, -0.1)}
    behind = TwinCamera(config.replace(**pose)).draw(*frames, 0)
    np.testing.assert_array_equal(behind.image, tissue)
    assert np.isnan(behind.true_features).all()


def test_nothing_nearer_than_two_millimetres_is_drawn() -> None:
    near = {
        "camera.camera_from_guide.translation": (0.030, 0.0, 1.5e-3),
        "camera.camera_from_guide.rotation": (0.0, -np.pi / 2, 0.0),
        "instrument.diameter": 0.4e-3,
    }
    config, camera = make(**QUIET, **near)
    rendered = camera.draw(*bent(config, 1e-3, 0.0, 0.0), 0)
    np.testing.assert_array_equal(rendered.image, camera.draw(*NO_INSTRUMENT, 0).image)
    assert np.isnan(rendered.true_features).all()


def test_geometry_that_passes_the_camera_is_clipped() -> None:
    config, camera = make(**QUIET)
    tissue = camera.draw(*NO_INSTRUMENT, 0).image
    pose = {
        "camera.camera_from_guide.translation": (0.004, 0.003, -0.03),
        "camera.camera_from_guide.rotation": (0.0, 0.0, 0.0),
    }
    through = TwinCamera(config.replace(**pose))
    rendered = through.draw(*bent(config, 20e-3, 0.0, 0.0), 0)
    changed = (rendered.image != tissue).any(axis=-1)
    assert 0.001 < changed.mean() < 0.5
    # What is in front of the camera is right of and below the axis.
    assert not changed[: int(config.camera.cy) - 60, : int(config.camera.cx) - 60].any()


def test_any_geometry_gives_an_image() -> None:
    rng = np.random.default_rng(5)
    config, camera = make(**QUIET)
    for trial in range(150):
        n = int(rng.integers(2, 30))
        scale = 10.0 ** rng.choice([-12, -3, -2, -1, 0, 3, 30, 160, 300])
        points = scale * rng.standard_normal((n, 3))
        directions = rng.standard_normal((n, 3)) * 10.0 ** rng.choice([-300, 0, 200])
        if trial % 3 == 0:
            where = rng.integers(n), rng.integers(3)
            (points if trial % 2 else directions)[where] = rng.choice([np.nan, np.inf, -np.inf, 0])
        if trial % 5 == 0:
            points[:] = points[0]
        rendered = camera.draw(points, directions, trial)
        assert rendered.image.shape == (config.camera.height, config.camera.width, 3)
        assert rendered.image.dtype == np.uint8
        assert rendered.true_features.shape == (4,)
    # No trial changes later images.
    clean = TwinCamera(config).draw(*NO_INSTRUMENT, 0).image
    np.testing.assert_array_equal(camera.draw(*NO_INSTRUMENT, 0).image, clean)


def test_images_do_not_share_memory() -> None:
    _, camera = make(**QUIET)
    first = camera.draw(*NO_INSTRUMENT, 0).image
    first[:] = 0
    assert camera.draw(*NO_INSTRUMENT, 0).image.any()


@pytest.mark.parametrize(
    ("points", "directions", "sequence", "field"),
    [
        (np.zeros((3, 2)), np.zeros((3, 2)), 0, "points"),
        (np.zeros((1, 3)), np.zeros((1, 3)), 0, "points"),
        (np.zeros(3), np.zeros(3), 0, "points"),
        (np.zeros((3, 3)), np.zeros((2, 3)), 0, "directions"),
        (np.zeros((3, 3)), np.zeros((3, 3)), -1, "sequence"),
    ],
)
def test_centrelines_of_wrong_shape_are_rejected(
    points: Array, directions: Array, sequence: int, field: str
) -> None:
    _, camera = make()
    with pytest.raises(FieldError) as caught:
        camera.draw(points, directions, sequence)
    assert caught.value.field == field


def test_invalid_camera_parameters_are_named() -> None:
    with pytest.raises(ConfigError) as caught:
        make(**{"twin.image_noise": 300.0})
    assert caught.value.field == "twin.image_noise"


@pytest.mark.parametrize("size", [(1, 1), (33, 7), (1280, 720)])
def test_any_image_size(size: tuple[int, int]) -> None:
    config, camera = make(**{"camera.width": size[0], "camera.height": size[1]})
    image = camera.draw(*bent(config, 20e-3, 0.3, 0.9), 0).image
    assert image.shape == (size[1], size[0], 3)


def test_backgrounds_are_shown_in_turn(tmp_path: Path) -> None:
    grey = [40, 120, 200]
    for name, level in zip(["b.png", "a.png", "c.png"], grey, strict=True):
        cv2.imwrite(str(tmp_path / name), np.full((30, 40, 3), level, np.uint8))
    config, camera = make(**QUIET, **{"twin.background": str(tmp_path)})
    levels = [camera.draw(*NO_INSTRUMENT, k * FRAMES_PER_BACKGROUND).image for k in range(4)]
    assert [int(image.mean().round()) for image in levels] == [120, 40, 200, 120]
    assert camera.draw(*NO_INSTRUMENT, FRAMES_PER_BACKGROUND - 1).image[0, 0, 0] == 120
    assert levels[0].shape == (config.camera.height, config.camera.width, 3)
