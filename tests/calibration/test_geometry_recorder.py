"""Images of a calibration motion: what is kept of them in each format, and which band is A."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope.calibration.geometry import Patch, Recorder, Recording
from tautscope.calibration.images import to_bgr
from tautscope.config import Config, PixelFormat, load_config
from tautscope.loop.construction import build_feature_model

Image = NDArray[np.uint8]
FORMATS = ("bgr", "rgb", "bgra", "yuyv", "uyvy", "nv12", "i420")
GREEN = (60, 200, 60)


def converted(image: Image, pixel_format: PixelFormat) -> Image:
    """An image B, G, R in another format."""
    if pixel_format == "bgra":
        return np.dstack([image, np.full(image.shape[:2], 255, np.uint8)])
    if pixel_format == "nv12":  # I420 with U and V interleaved
        height, width = image.shape[:2]
        planes = cv2.cvtColor(image, cv2.COLOR_BGR2YUV_I420)
        colour = planes[height:].reshape(2, -1).T.reshape(height // 2, width)
        return np.vstack([planes[:height], colour])
    codes = {"rgb": "BGR2RGB", "yuyv": "BGR2YUV_YUYV", "uyvy": "BGR2YUV_UYVY"}
    code = (codes | {"i420": "BGR2YUV_I420"}).get(pixel_format)
    return image if code is None else cv2.cvtColor(image, getattr(cv2, f"COLOR_{code}"))


def camera_of(pixel_format: PixelFormat, size: tuple[int, int] = (720, 576)) -> Config:
    changes = {"pixel_format": pixel_format, "width": size[0], "height": size[1]}
    return load_config().replace(**{f"camera.{key}": value for key, value in changes.items()})


def recorded(config: Config, *images: Image) -> Recording:
    recorder = Recorder(config)
    recorder.add_tick(0.0, np.zeros(3))
    for k, image in enumerate(images):
        recorder.add_image(converted(image, config.camera.pixel_format), 0.1 * k)
    return recorder.recording()


@pytest.mark.parametrize("pixel_format", FORMATS)
def test_white_is_saturated_in_every_format(pixel_format: PixelFormat) -> None:
    config = camera_of(pixel_format)
    for level, share in ((255, 0.25), (128, 0.0), (0, 0.0)):
        image = np.full((576, 720, 3), 100, np.uint8)
        image[:, :180] = level
        assert recorded(config, image).saturated == share, level


@pytest.mark.parametrize("pixel_format", FORMATS)
def test_what_was_not_kept_is_black_in_every_format(pixel_format: PixelFormat) -> None:
    config = camera_of(pixel_format, (48, 26))
    noise = np.random.default_rng(0).integers(40, 200, (26, 48, 3), np.uint8)
    image = converted(noise, pixel_format)
    patch = Patch.cut(image, pixel_format, (5, 3, 22, 15))
    whole = patch.image(config.camera)
    kept, shown = (to_bgr(each, pixel_format).copy() for each in (image, whole))
    np.testing.assert_array_equal(shown[3:15, 5:22], kept[3:15, 5:22])
    shown[2:16, 4:22] = 0
    assert not shown.any()
    assert patch.pixels.nbytes == image.nbytes * (14 * 18) / (26 * 48)


def with_bands(size: tuple[int, int]) -> Image:
    image = np.full((size[1], size[0], 3), (95, 110, 190), np.uint8)
    for left in (900, 1000):
        cv2.rectangle(image, (left, 500), (left + 40, 530), GREEN, cv2.FILLED)
    return image


@pytest.mark.parametrize("pixel_format", ["bgr", "nv12", "i420"])
def test_only_the_bands_surroundings_are_kept(pixel_format: PixelFormat) -> None:
    """A minute has 750 images."""
    size = 1920, 1080
    plain, bands = np.full((1080, 1920, 3), 128, np.uint8), with_bands(size)
    inset = bands.copy()  # far away, in the markers' colour
    cv2.rectangle(inset, (20, 1000), (30, 1010), GREEN, cv2.FILLED)
    none, pair, far = recorded(camera_of(pixel_format, size), plain, bands, inset).patches
    assert none.pixels.size == 0
    assert 0 < pair.pixels.nbytes == far.pixels.nbytes < 0.2e6
    whole = to_bgr(pair.image(camera_of(pixel_format, size).camera), pixel_format)
    expected = to_bgr(converted(bands, pixel_format), pixel_format)
    np.testing.assert_array_equal(whole[460:570, 860:1080], expected[460:570, 860:1080])


def test_the_bands_are_ordered_by_the_motors_at_the_time_of_the_image() -> None:
    """Of a video all positions of the motors come before the first image."""
    config = load_config()
    recorder, model = Recorder(config), build_feature_model(config)
    sines = config.experiment
    motors = [np.array([sines.insertion.centre, rotation, 0.8]) for rotation in (0.0, np.pi)]
    expected = np.array([model.predict(each)[0] for each in motors])
    directions = expected[:, 2:] - expected[:, :2]
    assert directions[0] @ directions[1] < 0
    for k, each in enumerate(motors):
        recorder.add_tick(float(k), each)
    for k, features in enumerate(expected):
        image = np.full((576, 720, 3), (95, 110, 190), np.uint8)
        for centre in np.rint(features.reshape(2, 2)).astype(int):
            cv2.circle(image, centre, 14, GREEN, cv2.FILLED)
        assert not recorder.add_image(image, k + 0.3).valid
    np.testing.assert_allclose(recorder.recording().features, expected, atol=1.5)
