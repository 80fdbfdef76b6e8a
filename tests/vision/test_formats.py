"""Every pixel format is the same image: against OpenCV's conversions, and what is refused."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.errors import ConfigError, FrameError
from tautscope.loop.vision import MarkerDetector

Image = NDArray[np.uint8]
SIZE = (96, 208)
TO_BGR = {
    "bgr": None,
    "rgb": cv2.COLOR_RGB2BGR,
    "bgra": cv2.COLOR_BGRA2BGR,
    "yuyv": cv2.COLOR_YUV2BGR_YUYV,
    "uyvy": cv2.COLOR_YUV2BGR_UYVY,
    "nv12": cv2.COLOR_YUV2BGR_NV12,
    "i420": cv2.COLOR_YUV2BGR_I420,
}


def shape(pixel_format: str, size: tuple[int, int] = SIZE) -> tuple[int, ...]:
    height, width = size
    if pixel_format in ("nv12", "i420"):
        return (height * 3 // 2, width)
    return (height, width, {"bgra": 4, "yuyv": 2, "uyvy": 2}.get(pixel_format, 3))


def detector(pixel_format: str, size: tuple[int, int] = SIZE, **changes: object) -> MarkerDetector:
    camera = {"height": size[0], "width": size[1], "pixel_format": pixel_format}
    camera = {f"camera.{key}": value for key, value in camera.items()}
    return MarkerDetector(Config().replace(**camera, **{"vision.minimum_area": 5, **changes}))


def muted(pixel_format: str, seed: int) -> Image:
    """Random bytes whose colour lies inside the cube, smooth enough for regions."""
    rng = np.random.default_rng(seed)
    if pixel_format in ("bgr", "rgb", "bgra"):
        low, high = 0, 256
    else:
        low, high = 108, 149
    return rng.integers(low, high, shape(pixel_format), dtype=np.uint8)


@pytest.mark.parametrize("pixel_format", TO_BGR)
@pytest.mark.parametrize("seed", range(4))
def test_decides_as_after_opencvs_conversion(pixel_format: str, seed: int) -> None:
    image = muted(pixel_format, seed)
    code = TO_BGR[pixel_format]
    bgr = image if code is None else cv2.cvtColor(image, code)
    weights = np.array(Config().vision.weights)
    threshold = float(np.median(bgr @ weights))
    detected = detector(pixel_format, **{"vision.smoothing": 0, "vision.threshold": threshold})
    above = bgr @ weights - threshold
    # OpenCV rounds B, G, R to whole grey levels, we do not: half a level of each weight.
    decided = abs(above) > 0.5 * abs(weights).sum() + 0.3
    assert decided.mean() > 0.5
    assert 0.2 < (above > 0).mean() < 0.8
    mask = detected.mask(image)
    np.testing.assert_array_equal(mask[decided], (above > 0)[decided], f"{seed=}")


@pytest.mark.parametrize("pixel_format", TO_BGR)
def test_cropped_views_are_read_in_place(pixel_format: str) -> None:
    image = muted(pixel_format, 1)
    padded = np.full((image.shape[0] + 3, image.shape[1] + 5, *image.shape[2:]), 77, np.uint8)
    view = padded[2:-1, 4:-1]
    view[:] = image
    found = detector(pixel_format)
    assert not view.flags.c_contiguous
    np.testing.assert_array_equal(found.mask(view), found.mask(image))
    assert found.detect(view).regions == found.detect(image).regions


@pytest.mark.parametrize("pixel_format", TO_BGR)
def test_other_arrays_are_refused(pixel_format: str) -> None:
    image = muted(pixel_format, 1)
    refused = {
        "upside down": image[::-1],
        "mirrored": image[:, ::-1],
        "every second column": np.repeat(image, 2, axis=1)[:, ::2],
        "by columns": np.asfortranarray(image),
        "signed": image.view(np.int8),
        "real": image.astype(np.float32),
        "a row less": image[:-1],
        "a column less": image[:, :-1],
        "one axis more": image[None],
        "flat": image.reshape(-1),
        "no array": image.tolist(),
    }
    found = detector(pixel_format)
    for name, wrong in refused.items():
        expected = rf"^image: got .* expected uint8 array .*{pixel_format}"
        with pytest.raises(FrameError, match=expected) as error:
            found.detect(wrong)
        assert error.value.field == "image", name


@pytest.mark.parametrize("pixel_format", ["yuyv", "uyvy", "nv12", "i420"])
def test_odd_sides_are_refused_where_colour_is_shared(pixel_format: str) -> None:
    with pytest.raises(ConfigError, match=r"^camera\.width: got 33, expected even"):
        Config().replace(**{"camera.width": 33, "camera.pixel_format": pixel_format})
    if pixel_format in ("nv12", "i420"):
        with pytest.raises(ConfigError, match=r"^camera\.height: got 21, expected even"):
            detector(pixel_format, (21, 32))
    else:
        assert detector(pixel_format, (21, 32)).mask(np.zeros((21, 32, 2), np.uint8)).shape


def test_an_unknown_format_is_refused_by_name() -> None:
    with pytest.raises(ConfigError, match=r"^camera\.pixel_format: got 'grey'"):
        Config().replace(**{"camera.pixel_format": "grey"})
