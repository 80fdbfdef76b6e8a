"""The centroid of a band's visible surface (decision 0002) against numerical integration."""

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.loop.construction import build_camera, build_feature_model, build_instrument

Floats = NDArray[np.float64]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(12)


def guide_to_camera(config: Config) -> tuple[Floats, Floats]:
    pose = config.camera.camera_from_guide
    return cv2.Rodrigues(np.array(pose.rotation))[0], np.array(pose.translation)


def tip_axis(state: Floats) -> Floats:
    _, rotation, bend = state
    return np.array(
        [np.sin(bend) * np.cos(rotation), np.sin(bend) * np.sin(rotation), np.cos(bend)]
    )


def visible_centroid(config: Config, centre: Floats, axis: Floats) -> Floats:
    """Mean pixel of the visible half of a cylinder, by quadrature over length and azimuth."""
    camera, instrument = build_camera(config), config.instrument
    radius = instrument.diameter / 2
    across = -centre + (centre @ axis) * axis
    distance = np.linalg.norm(across)
    towards = across / distance
    sideways = np.cross(axis, towards)
    horizon = np.arccos(radius / distance)
    along, azimuth = np.meshgrid(instrument.band_length / 2 * NODES, horizon * NODES)
    normals = np.cos(azimuth)[..., None] * towards + np.sin(azimuth)[..., None] * sideways
    points = (centre + along[..., None] * axis + radius * normals).reshape(-1, 3)
    facing = -np.einsum("ij,ij->i", points, normals.reshape(-1, 3))
    # Area in the image per area of surface: foreshortening, distance, lens.
    magnification = np.array([np.linalg.det(camera.jacobian(p)[:, :2]) for p in points])
    weights = np.outer(WEIGHTS, WEIGHTS).ravel() * facing / points[:, 2] * magnification
    return weights @ camera.project(points) / weights.sum()


def sweep() -> Floats:
    """States of the experiment: one DOF moves, the others are constant."""
    experiment = Config().experiment
    sines = [experiment.insertion, experiment.rotation, experiment.bending]
    rest = np.array([sine.centre for sine in sines])
    return np.array(
        [
            rest + share * sine.amplitude * np.eye(3)[dof]
            for dof, sine in enumerate(sines)
            for share in np.linspace(-1.0, 1.0, 9)
        ]
    )


def errors(config: Config, model_config: Config) -> Floats:
    """Distance between predicted and integrated centroid [px], per state and band."""
    rotation, translation = guide_to_camera(config)
    model, instrument = build_feature_model(model_config), build_instrument(config)
    distances = []
    for state in sweep():
        prediction = model.predict(state)
        assert prediction is not None
        centres = instrument.markers(state) @ rotation.T + translation
        axis = rotation @ tip_axis(state)
        for found, centre in zip(prediction[0].reshape(2, 2), centres, strict=True):
            distances.append(np.linalg.norm(found - visible_centroid(config, centre, axis)))
    return np.array(distances)


def test_without_distortion_the_model_equals_the_integral() -> None:
    config = Config().replace(**{"camera.distortion": [0.0] * 8})
    assert errors(config, config).max() < 0.05


def test_with_distortion_the_error_is_below_the_marker_noise() -> None:
    config = Config()
    found = errors(config, config)
    assert np.sqrt((found**2).mean()) < 0.15
    assert found.max() < 0.4


def thin(size: float) -> dict[str, object]:
    """Bands that are points, which no instrument has."""
    keys = ("instrument.diameter", "instrument.band_length")
    return {**dict.fromkeys(keys, size), "safety.unusual": keys}


def test_the_image_of_the_bands_centre_is_not_the_centroid() -> None:
    """The reason for decision 0002: the error of the article's h is several px."""
    config = Config()
    points = config.replace(**thin(1e-9))
    assert np.median(errors(config, points)) > 5.0


def test_without_thickness_the_model_is_the_articles() -> None:
    config = Config().replace(**thin(1e-12))
    rotation, translation = guide_to_camera(config)
    model, instrument, camera = (
        build_feature_model(config),
        build_instrument(config),
        build_camera(config),
    )
    for state in sweep():
        prediction = model.predict(state)
        assert prediction is not None
        expected = camera.project(instrument.markers(state) @ rotation.T + translation)
        np.testing.assert_allclose(prediction[0], expected.ravel(), atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"camera.camera_from_guide.translation": [0.0, 0.0, -0.2]}, "behind the camera"),
        (
            {
                "camera.camera_from_guide.translation": [1e-4, 0.0, 0.01],
                "camera.camera_from_guide.rotation": [0.0, 0.0, 0.0],
            },
            "seen along its axis",
        ),
        ({"camera.distortion": [-300.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]}, "folded over"),
    ],
)
def test_an_invisible_band_has_no_features(changes: dict[str, object], why: str) -> None:
    model = build_feature_model(Config().replace(**changes))
    assert model.predict([0.025, 0.0, 0.0]) is None, why
    assert build_feature_model(Config()).predict([np.nan, 0.0, 0.0]) is None
