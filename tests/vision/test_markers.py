"""Which of what is green is band A, which band B, and what is neither."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scenes import CONFIG, DEVIATION, MODEL, Scene, cut_scenes, scenes
from tautscope.loop.state_prediction import StatePrediction
from tautscope.loop.vision import Detection, MarkerDetector

Image = NDArray[np.uint8]

SCENES = scenes(8, seed=3)
CUT = cut_scenes(24, seed=8)
DETECTOR = MarkerDetector(CONFIG)
MUCOSA = (60, 70, 140)
GREEN = (70, 190, 60)
WHITE = (255, 255, 255)


def error(detection: Detection, scene: Scene) -> float:
    """Of the worse of the bands that were found [px]."""
    return float(np.nanmax(np.hypot(*(detection.features - scene.truth).reshape(2, 2).T)))


def draw(scene: Scene, paint: Callable[[Image], object]) -> Image:
    image = scene.image.copy()
    paint(image)
    return image


def cover(scene: Scene, band: int, share: float, colour: tuple[int, int, int]) -> Image:
    """A lump at a corner of a band hides it within this share of its diagonal."""
    outline = scene.outline(band)
    corner, opposite = outline[0], outline[len(outline) // 2]
    radius = share * np.hypot(*(opposite - corner))
    centre = np.rint(corner).astype(int)
    return draw(scene, lambda image: cv2.circle(image, centre, round(radius), colour, cv2.FILLED))


def wipe(scene: Scene, band: int) -> Image:
    """The band has the tissue's colour."""
    outline = np.rint(scene.outline(band)).astype(int)
    return draw(
        scene,
        lambda image: cv2.polylines(
            cv2.fillPoly(image, [outline], MUCOSA), [outline], True, MUCOSA, 5
        ),
    )


@pytest.mark.parametrize("number", range(len(SCENES)))
def test_found_with_an_expectation_with_features_and_without_either(number: int) -> None:
    scene = SCENES[number]
    features, _ = MODEL.predict(scene.state) or (None, None)
    for detection in (
        DETECTOR.detect(scene.image, expectation=scene.expectation(number)),
        DETECTOR.detect(scene.image, features),
        DETECTOR.detect(scene.image),
    ):
        assert detection.valid and detection.found == (True, True), detection.reason
        assert detection.reason == ""
        assert error(detection, scene) < 1.2


@pytest.mark.parametrize("number", range(len(CUT)))
def test_a_band_cut_by_the_border_is_found_whole(number: int) -> None:
    scene = CUT[number]
    detection = DETECTOR.detect(scene.image, expectation=scene.expectation(number))
    assert detection.valid, (scene.state, detection.reason)
    assert min(score.inside for score in detection.scores) < 0.7
    assert error(detection, scene) < 1.5, scene.state


@pytest.mark.parametrize("number", range(len(SCENES)))
@pytest.mark.parametrize("band", [0, 1])
def test_one_band_alone_is_partial_and_says_why(number: int, band: int) -> None:
    scene = SCENES[number]
    image = wipe(scene, band)
    tight = StatePrediction(scene.state, DEVIATION / 4)
    detection = DETECTOR.detect(image, expectation=tight)
    assert not detection.valid
    assert detection.reasons[band] and not detection.reasons[1 - band], detection.reason
    assert detection.reason.startswith(f"band {'AB'[band]}: ")
    lost = slice(2 * band, 2 * band + 2)
    assert np.isnan(detection.features[lost]).all()
    assert np.isnan(detection.covariance[lost]).all()
    assert np.isfinite(detection.features).sum() == 2
    assert error(detection, scene) < 1.0


@pytest.mark.parametrize("number", range(len(SCENES)))
@pytest.mark.parametrize("band", [0, 1])
@pytest.mark.parametrize("share", [0.3, 0.5])
def test_a_band_with_a_covered_corner_is_found_whole(number: int, band: int, share: float) -> None:
    scene = SCENES[number]
    image = cover(scene, band, share, MUCOSA)
    detection = DETECTOR.detect(image, expectation=scene.expectation(number))
    assert detection.valid, detection.reason
    assert error(detection, scene) < 2.0


@pytest.mark.parametrize("number", range(len(SCENES)))
def test_a_highlight_across_a_band_leaves_one_band(number: int) -> None:
    scene = SCENES[number]
    outline = scene.outline(0)
    half = len(outline) // 2
    ends = outline[:half].mean(axis=0), outline[half:].mean(axis=0)
    image = draw(
        scene,
        lambda image: cv2.line(image, *(np.rint(end).astype(int) for end in ends), WHITE, 4),
    )
    detection = DETECTOR.detect(image, expectation=scene.expectation(number))
    assert detection.valid, detection.reason
    assert error(detection, scene) < 1.0


@pytest.mark.parametrize("number", range(len(SCENES)))
def test_other_green_things_change_nothing(number: int) -> None:
    scene = SCENES[number]
    centre = np.rint(scene.truth.reshape(2, 2).mean(axis=0)).astype(int)

    def clutter(image: Image) -> None:
        for way in ((-190, 0), (190, 0), (0, 170), (0, -170)):
            left, top = centre + way
            cv2.rectangle(image, (left - 35, top - 30), (left + 35, top + 30), GREEN, cv2.FILLED)

    detection = DETECTOR.detect(draw(scene, clutter), expectation=scene.expectation(number))
    assert detection.valid, detection.reason
    assert error(detection, scene) < 1.0


@pytest.mark.parametrize("number", range(len(SCENES)))
@pytest.mark.parametrize("thing", ["inset", "stool", "text", "bands' size", "nothing", "noise"])
def test_without_an_instrument_nothing_is_found(number: int, thing: str) -> None:
    scene = SCENES[number]
    rng = np.random.default_rng(number)
    image = np.full((576, 720, 3), MUCOSA, np.uint8)
    ua, va, ub, vb = np.rint(scene.truth).astype(int).tolist()
    match thing:
        case "inset":
            cv2.rectangle(image, (ua - 80, va - 60), (ub + 80, vb + 60), GREEN, cv2.FILLED)
        case "stool":
            cv2.circle(image, (ua, va), 40, (40, 130, 100), cv2.FILLED)
            cv2.ellipse(image, (ub, vb), (60, 25), 30, 0, 360, (40, 130, 100), cv2.FILLED)
        case "text":
            cv2.putText(image, "GREEN", (ua - 40, va), cv2.FONT_HERSHEY_PLAIN, 2, GREEN, 2)
        case "bands' size":
            cv2.circle(image, (ua, va), 8, GREEN, cv2.FILLED)
            cv2.drawMarker(image, (ub, vb), GREEN, cv2.MARKER_CROSS, 25, 5)
        case "noise":
            image = rng.integers(0, 256, image.shape, dtype=np.uint8)
    for detection in (
        DETECTOR.detect(image, expectation=scene.expectation()),
        DETECTOR.detect(image, scene.truth),
        DETECTOR.detect(image),
    ):
        assert not detection.valid
        assert all(detection.reasons) or thing == "bands' size", detection.found


@pytest.mark.parametrize("seed", range(4))
def test_exposure_and_white_balance(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for scene in SCENES:
        for gain in (0.25, 0.5, 2.0):
            light = np.clip(scene.image * gain, 0, 255).astype(np.uint8)
            detection = DETECTOR.detect(light, expectation=scene.expectation(seed))
            assert detection.valid, f"{gain}: {detection.reason}"
            assert error(detection, scene) < 1.5, gain
        gains = 1.2 ** rng.uniform(-1, 1, 3)
        coloured = np.clip(scene.image * gains, 0, 255).astype(np.uint8)
        detection = DETECTOR.detect(coloured, expectation=scene.expectation(seed))
        assert detection.valid, f"{gains}: {detection.reason}"
        assert error(detection, scene) < 1.5, gains


@pytest.mark.parametrize("away", [(0.0, 1.5, 0.0), (0.012, 0.0, 0.0), (0.0, 0.0, -0.8)])
def test_clear_bands_are_found_where_they_are_not_where_they_are_expected(
    away: tuple[float, float, float],
) -> None:
    for scene in (scene for scene in SCENES if scene.state[2] > 0.5):
        elsewhere = StatePrediction(scene.state + np.array(away), DEVIATION / 3)
        detection = DETECTOR.detect(scene.image, expectation=elsewhere)
        assert detection.valid, (scene.state, detection.reason)
        assert error(detection, scene) < 1.5


@pytest.mark.parametrize("seed", range(6))
def test_clear_bands_are_found_with_a_wrong_geometry(seed: int) -> None:
    """Camera 2 deg and 2 mm off, in any direction; bands 0.4 mm."""
    rng = np.random.default_rng(seed)
    turn, shift = (each / np.linalg.norm(each) for each in rng.standard_normal((2, 3)))
    pose = CONFIG.camera.camera_from_guide
    turned = cv2.Rodrigues(np.deg2rad(2.0) * turn)[0] @ cv2.Rodrigues(np.array(pose.rotation))[0]
    told = CONFIG.replace(
        **{
            "camera.camera_from_guide.rotation": tuple(cv2.Rodrigues(turned)[0].ravel().tolist()),
            "camera.camera_from_guide.translation": tuple(
                (np.array(pose.translation) + 2e-3 * shift).tolist()
            ),
            "instrument.marker_a": CONFIG.instrument.marker_a + rng.choice([-1, 1]) * 4e-4,
            "instrument.marker_b": CONFIG.instrument.marker_b + rng.choice([-1, 1]) * 4e-4,
        }
    )
    detector = MarkerDetector(told)
    detections = [(detector.detect(scene.image), scene) for scene in SCENES]
    found = [error(detection, scene) for detection, scene in detections if detection.valid]
    print(f"seed {seed}: {len(found)} of {len(SCENES)}, {max(found):.2f} px")
    assert len(found) == len(SCENES)
    assert max(found) < 2.5
