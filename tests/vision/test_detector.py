"""Frame to markers: the segmentation against OpenCV, what is refused, what is left behind."""

import time
from concurrent.futures import ThreadPoolExecutor

import cv2
import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from scenes import scenes
from tautscope import _core
from tautscope.config import Config
from tautscope.errors import ConfigError, FieldError, FrameError
from tautscope.loop import vision
from tautscope.loop.construction import build_feature_model
from tautscope.loop.vision import MarkerDetector

Image = NDArray[np.uint8]


def config(size: tuple[int, int], **changes: object) -> Config:
    return Config().replace(**{"camera.height": size[0], "camera.width": size[1], **changes})


def tolerance(config: Config) -> float:
    """The bound that MarkerDetector documents."""
    weights = np.array(config.vision.weights)
    side = max(weights.clip(0).sum(), -weights.clip(max=0).sum())
    return float((1.25 + config.vision.smoothing) * 255 * side / 8190)


def textbook(image: Image, config: Config) -> NDArray[np.float64]:
    """The low-passed weighted sum in double precision: filter three channels, then project."""
    filtered = image.astype(np.float64)
    for _ in range(config.vision.smoothing):
        kernel = np.array([1.0, 2.0, 1.0]) / 4
        border = cv2.BORDER_REPLICATE
        filtered = cv2.sepFilter2D(filtered, cv2.CV_64F, kernel, kernel, borderType=border)
    return filtered.reshape(image.shape) @ np.array(config.vision.weights)


def noise(size: tuple[int, int], seed: int) -> Image:
    return np.random.default_rng(seed).integers(0, 256, (*size, 3), dtype=np.uint8)


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (2, 3), (3, 2), (37, 61)], ids=str)
@pytest.mark.parametrize("smoothing", range(9))
def test_mask_is_opencvs_up_to_ties(size: tuple[int, int], smoothing: int) -> None:
    undecided = total = 0
    for seed in range(5):
        rng = np.random.default_rng(seed)
        weights, threshold = rng.uniform(-1, 1, 3).tolist(), float(rng.uniform(-20, 20))
        settings = {"vision.weights": weights, "vision.threshold": threshold}
        cfg = config(size, **settings, **{"vision.smoothing": smoothing})
        image = noise(size, seed)
        above = textbook(image, cfg) - threshold
        decided = abs(above) > tolerance(cfg)
        mask = MarkerDetector(cfg).mask(image)
        np.testing.assert_array_equal(mask[decided], (above > 0)[decided], f"{seed=}")
        undecided, total = undecided + (~decided).sum(), total + decided.size
    assert undecided <= max(2, 0.05 * total)


def test_regions_are_those_of_the_mask() -> None:
    # Without alternatives the regions are those of the first discriminant.
    cfg = config(
        (90, 120),
        **{
            "vision.minimum_area": 5,
            "vision.alternatives": [],
            "vision.unlocated.alternatives": [],
        },
    )
    detector = MarkerDetector(cfg)
    for seed in range(5):
        image = cv2.GaussianBlur(noise((90, 120), seed), (0, 0), 2)
        mask = detector.mask(image).astype(np.uint8)
        _, _, stats, centroids = cv2.connectedComponentsWithStats(mask, connectivity=8)
        expected = sorted(
            (-area, *centroid, *box)
            for (*box, area), centroid in zip(stats[1:].tolist(), centroids[1:], strict=True)
            if area >= 5
        )
        regions = detector.detect(image).regions
        assert len(regions) == min(32, len(expected)) > 2, f"{seed=}"
        assert [-r.area for r in regions] == [e[0] for e in expected[:32]], f"{seed=}"
        for region in regions:
            assert (-region.area, *region.centroid, *region.box) in expected, f"{seed=}"


def test_views_are_read_as_their_copies() -> None:
    whole = cv2.GaussianBlur(noise((100, 160), 3), (0, 0), 2)
    detector = MarkerDetector(config((80, 120), **{"vision.minimum_area": 3}))
    views = {
        "cropped": whole[10:90, 15:135],
        "every second row": np.repeat(whole, 2, axis=0)[20:180:2, 15:135],
        "read-only": np.frombuffer(whole[:80, :120].tobytes(), np.uint8).reshape(80, 120, 3),
    }
    for name, view in views.items():
        copy = view.copy(order="C")
        np.testing.assert_array_equal(detector.mask(view), detector.mask(copy), name)
        assert detector.detect(view).regions == detector.detect(copy).regions, name
        assert detector.detect(view).regions, name


@pytest.mark.parametrize(
    "image",
    [
        None,
        [[[0, 0, 0]]],
        np.zeros((20, 30), np.uint8),
        np.zeros((30, 20, 3), np.uint8),
        np.zeros((20, 30, 4), np.uint8),
        np.zeros((20, 30, 3), np.float64),
        np.zeros((20, 30, 3), np.int8),
        np.zeros((0, 0, 3), np.uint8),
    ],
    ids=lambda image: f"{getattr(image, 'dtype', '')}{getattr(image, 'shape', image)}",
)
def test_what_is_not_an_image_is_refused(image: Image) -> None:
    detector = MarkerDetector(config((20, 30)))
    for call in (detector.detect, detector.mask):
        with pytest.raises(FrameError, match=r"^image: got .* expected uint8 array \(20, 30, 3\)"):
            call(image)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"weights": [0.0, 0.0, 0.0]}, r"weights: got .* expected finite weights"),
        ({"weights": [1e-12, 0.0, 0.0]}, r"weights: got .* expected finite weights"),
        ({"weights": [1.0, 1e300, 0.0]}, r"weights\[1\]: got 1e\+300"),
        ({"threshold": 1e3}, r"threshold: got '1000.0', expected .* weighted sum of a pixel"),
        ({"alternatives": [[[0, 1, 0], -256.0]]}, "alternatives: got '-256.0'"),
        ({"unlocated.alternatives": [[[0, 1, 0], 256.0]]}, "unlocated.alternatives: got '256.0'"),
    ],
)
def test_a_discriminant_that_tells_nothing_apart_is_refused(
    settings: dict[str, object], message: str
) -> None:
    with pytest.raises(ConfigError, match=rf"^vision\.{message}"):
        MarkerDetector(config((20, 30), **{f"vision.{key}": settings[key] for key in settings}))


@pytest.mark.parametrize("predicted", ["near", 3.0, [1, 2, 3], [[1, 2, 3, 4]], [1, 2, 3, None, 5]])
def test_what_is_not_a_prediction_is_refused(predicted: object) -> None:
    with pytest.raises(FieldError, match=r"^predicted_features: "):
        MarkerDetector(config((20, 30))).detect(np.zeros((20, 30, 3), np.uint8), predicted)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_prediction_that_is_not_finite_is_none(bad: float) -> None:
    scene = scenes(1, seed=5)[0]
    detector = MarkerDetector(Config())
    without = detector.detect(scene.image)
    assert without.valid
    np.testing.assert_array_equal(
        detector.detect(scene.image, [1.0, bad, 3.0, 4.0]).features, without.features
    )


def test_threads_may_share_a_detector() -> None:
    images = [cv2.GaussianBlur(noise((120, 160), seed), (0, 0), 2) for seed in range(8)] * 8
    detector = MarkerDetector(config((120, 160), **{"vision.minimum_area": 3}))
    alone = [detector.detect(image).regions for image in images]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda image: detector.detect(image).regions, images))
    assert together == alone
    assert len(set(alone)) > 1


def test_threads_that_make_detectors_at_once_make_one_posture_table(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made, workspace = [], vision._workspace

    def slow(settings: Config) -> NDArray[np.float64]:
        made.append(settings)
        time.sleep(0.1)
        return workspace(settings)

    monkeypatch.setattr(vision, "_tables", {})
    monkeypatch.setattr(vision, "_workspace", slow)
    with ThreadPoolExecutor(3) as pool:
        list(pool.map(MarkerDetector, [Config()] * 3))
    assert len(made) == 1


@pytest.mark.parametrize(
    ("change", "found"),
    [
        ({"colour": 1.0}, "unknown field `colour`"),
        ({"threshold": None}, "invalid type"),
        ({"fit": {}}, "missing field `edge_deviation`"),
    ],
)
def test_settings_are_exactly_those_of_the_configuration(
    change: dict[str, object], found: str
) -> None:
    settings = msgspec.to_builtins(Config().vision) | change
    model = build_feature_model(Config())
    with pytest.raises(ConfigError, match=rf"^vision: got .*{found}"):
        _core.MarkerDetector(
            model,
            "bgr",
            settings,
            _core.PostureTable(model, np.empty((0, 3))),
            np.zeros((1, 3)),
            np.ones(3),
        )


@pytest.mark.parametrize(
    ("change", "is_shared"),
    [
        ({"vision.minimum_area": 5}, True),
        ({"camera.source.url": "/dev/video1"}, True),
        ({"instrument.marker_a": 3e-3}, False),
        ({"experiment.bending.amplitude": 0.5}, False),
        ({"camera.fx": 425.0}, False),
        ({"camera.distortion": [-0.1, *[0.0] * 7]}, False),
        ({"camera.camera_from_guide.rotation": [0.3, -0.2, 0.0]}, False),
    ],
)
def test_detectors_of_a_geometry_share_its_postures(
    change: dict[str, object], is_shared: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    MarkerDetector(Config())
    made = []

    def make(*given: object) -> object:
        made.append(given)
        return table(*given)

    table = _core.PostureTable
    monkeypatch.setattr(_core, "PostureTable", make)
    changed = Config().replace(**change)
    MarkerDetector(changed)
    MarkerDetector(changed)
    assert len(made) == (0 if is_shared else 1)
