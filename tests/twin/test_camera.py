"""Position of the rendered bands, compared with OpenCV's projection and numerical integration."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest
from shapes import QUIET, Array, Centreline, bent, make
from tautscope.config import Config

FACING = {
    "camera.camera_from_guide.translation": (0.024, 0.0, 0.040),
    "camera.camera_from_guide.rotation": (0.0, -1.0, 0.0),
}
"""The instrument comes from the right and is viewed from the side."""


def in_camera(config: Config, vectors: Array, *, directions: bool = False) -> Array:
    pose = config.camera.camera_from_guide
    turned = vectors @ cv2.Rodrigues(np.array(pose.rotation))[0].T
    return turned if directions else turned + pose.translation


def opencv(config: Config, p_in_camera: Array) -> Array:
    camera = config.camera
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    rest = np.zeros(3)
    points, distortion = np.asarray(p_in_camera, float).reshape(-1, 3), np.array(camera.distortion)
    pixels = cv2.projectPoints(points, rest, rest, matrix, distortion)[0]
    return pixels.reshape(*np.shape(p_in_camera)[:-1], 2)


def band_centres(config: Config, points: Array, directions: Array) -> Centreline:
    """Centres of both bands on the tip's axis, and the axis, in the camera's frame."""
    instrument = config.instrument
    end = in_camera(config, points)[-1]
    axis = in_camera(config, directions, directions=True)[-1]
    markers = np.array([instrument.marker_a, instrument.marker_b])
    return end - (instrument.tip_length - markers)[:, None] * axis, axis


def near_sides(config: Config, points: Array, directions: Array) -> list[tuple[Array, Array]]:
    """Position and area in the image of small patches of each band's side towards the camera."""
    instrument = config.instrument
    centres, axis = band_centres(config, points, directions)
    across = np.cross(axis, [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across)
    other = np.cross(axis, across)
    edge_s = instrument.band_length * np.linspace(-0.5, 0.5, 25)
    edge_a = np.linspace(0, 2 * np.pi, 241)
    sides = []
    for centre in centres:
        s, a = np.meshgrid(edge_s, edge_a, indexing="ij")
        normal = np.cos(a)[..., None] * across + np.sin(a)[..., None] * other
        corner = opencv(config, centre + s[..., None] * axis + instrument.diameter / 2 * normal)
        down, along = np.diff(corner, axis=0)[:, :-1], np.diff(corner, axis=1)[:-1]
        area = np.abs(down[..., 0] * along[..., 1] - down[..., 1] * along[..., 0])
        s, a = np.meshgrid(
            (edge_s[1:] + edge_s[:-1]) / 2, (edge_a[1:] + edge_a[:-1]) / 2, indexing="ij"
        )
        normal = np.cos(a)[..., None] * across + np.sin(a)[..., None] * other
        patch = centre + s[..., None] * axis + instrument.diameter / 2 * normal
        sides.append((patch, np.where((normal * patch).sum(-1) < 0, area, 0)))
    return sides


def integrated(config: Config, points: Array, directions: Array) -> Array:
    """Centroids of the bands' sides towards the camera, by area in the image."""
    features = [
        (area[..., None] * opencv(config, patch)).sum((0, 1)) / area.sum()
        for patch, area in near_sides(config, points, directions)
    ]
    return np.ravel(features)


def visible(config: Config, frames: Centreline, hidden: Callable[[Array], Array]) -> Array:
    """Visible share of the bands' sides towards the camera, by area in the image."""
    return np.array(
        [area[~hidden(patch)].sum() / area.sum() for patch, area in near_sides(config, *frames)]
    )


@pytest.mark.parametrize("seed", range(12))
def test_bands_lie_where_opencv_projects_them_whatever_the_lens(seed: int) -> None:
    rng = np.random.default_rng(seed)
    coefficients = rng.uniform(-1, 1, 8) * [0.25, 0.08, 0.01, 0.01, 0.01, 0.1, 0.05, 0.01]
    lens = rng.uniform([350, 350, 320, 250], [600, 600, 400, 320])
    place = np.array([0.014, 0, 0.050]) + rng.uniform(-4e-3, 4e-3, 3)
    turn = np.array([0, -1.3, 0]) + rng.uniform(-0.3, 0.3, 3)
    config, camera = make(
        **QUIET,
        **dict(
            zip([f"camera.{key}" for key in ("fx", "fy", "cx", "cy")], lens.tolist(), strict=True)
        ),
        **{
            "camera.distortion": tuple(coefficients.tolist()),
            "camera.camera_from_guide.translation": tuple(place.tolist()),
            "camera.camera_from_guide.rotation": tuple(turn.tolist()),
            "instrument.diameter": 2e-3,
        },
    )
    for _ in range(4):
        state = rng.uniform([0, -3, -0.3], [4e-3, 3, 0.6])
        frames = bent(config, *state)
        expected = integrated(config, *frames)
        assert ((expected > 20) & (expected < np.tile([700, 556], 2))).all(), (
            f"bands left the view: {expected}"
        )
        drawn = camera.draw(*frames, 0).true_features
        assert np.abs(drawn - expected).max() < 0.05, f"seed {seed}, state {state}"


@pytest.mark.parametrize("rotation", [0.9, 1.9, 2.6, 3.7, 5.2])
@pytest.mark.parametrize("bending", [0.0, 0.4, 0.9, 1.3])
def test_bands_of_a_thick_tube_lie_at_the_centroid_of_their_visible_side(
    rotation: float, bending: float
) -> None:
    config, camera = make(**QUIET, **FACING)
    frames = bent(config, 8e-3, rotation, bending)
    expected = integrated(config, *frames)
    seen = camera.draw(*frames, 0).true_features
    assert np.abs(seen - expected).max() < 0.1, (seen, expected)


def crossing(offset: float) -> Centreline:
    """Centreline, in the guide's frame, of an instrument whose shaft passes in front of its tip."""
    level = [
        [40e-3, 0, 0],
        [0, 0, 0],
        [-25e-3, 0, 12e-3],
        [0, offset, 25e-3],
        [20e-3, offset, 25e-3],
    ]
    along = [[-1, 0, 0], [-1, 0, 0], [0, 0, 1], [1, 0, 0], [1, 0, 0]]
    return np.array(level, float), np.array(along, float)


CROSSED = {
    **QUIET,
    "camera.camera_from_guide.translation": (0.0, 0.0, 30e-3),
    "camera.camera_from_guide.rotation": (0.0, 0.0, 0.4),
}


def test_bands_behind_the_shaft_are_not_visible() -> None:
    config, camera = make(**CROSSED)
    drawn = camera.draw(*crossing(0.0), 0).true_features
    assert np.isnan(drawn).all()
    free = camera.draw(*crossing(12e-3), 0).true_features
    assert np.abs(free - integrated(config, *crossing(12e-3))).max() < 0.1


@pytest.mark.parametrize("offset", [2.3e-3, 2.8e-3, -2.5e-3])
def test_half_hidden_bands_keep_their_centroid_and_show_less(offset: float) -> None:
    config, camera = make(**CROSSED)

    place, along = (in_camera(config, crossing(offset)[k], directions=k == 1)[0] for k in (0, 1))

    def hidden(patch: Array) -> Array:
        # A ray meets the straight shaft if its distance from the shaft's axis is below the radius.
        normal = np.cross(along, patch)
        distance = np.abs(normal @ place) / np.linalg.norm(normal, axis=-1)
        return np.asarray(distance < config.instrument.diameter / 2)

    seen = camera.draw(*crossing(offset), 0)
    expected = integrated(config, *crossing(offset))
    assert np.abs(seen.true_features - expected).max() < 0.1, (seen.true_features, expected)
    shares = visible(config, crossing(offset), hidden)
    assert (shares > 0.1).all() and (shares < 0.9).all(), shares
    assert np.abs(seen.true_visible - shares).max() < 0.02, (seen.true_visible, shares)


@pytest.mark.parametrize("cut", [0.3, 0.5, 0.8])
def test_bands_partly_outside_keep_their_centroid_and_show_less(cut: float) -> None:
    config, _ = make(**QUIET, **FACING)
    frames = bent(config, 8e-3, 0.9, 0.4)
    place, area = near_sides(config, *frames)[1]
    u = np.ravel(opencv(config, place)[..., 0])
    order = np.argsort(u)
    share = np.cumsum(area.ravel()[order]) / area.sum()
    edge = float(u[order][np.searchsorted(share, cut)])
    # The principal point moves so that band B crosses the left border.
    moved, camera = make(**QUIET, **FACING, **{"camera.cx": config.camera.cx - edge - 0.5})
    seen = camera.draw(*frames, 0)
    assert seen.true_visible[1] == pytest.approx(1 - cut, abs=0.02)
    assert np.abs(seen.true_features - integrated(moved, *frames))[2:].max() < 0.1


def test_rendered_bands_match_the_true_features() -> None:
    config, camera = make(**QUIET, **FACING)
    for state in [(5e-3, 0, 0.0), (10e-3, 1, 0.7), (2e-3, -2, 1.0)]:
        rendered = camera.draw(*bent(config, *state), 0)
        blue, green, red = np.moveaxis(rendered.image.astype(float), -1, 0)
        rows, columns = np.nonzero((green > 1.35 * red) & (green > 1.35 * blue))
        pixels = np.stack([columns, rows], axis=1)
        bands = rendered.true_features.reshape(2, 2)
        nearest = np.linalg.norm(pixels[:, None] - bands, axis=-1).argmin(axis=1)
        for band in range(2):
            assert (nearest == band).sum() > 100
            # The mask has whole pixels, without highlights.
            assert np.linalg.norm(pixels[nearest == band].mean(0) - bands[band]) < 1.0, state


@pytest.mark.parametrize("depth", [15e-3, 30e-3, 50e-3, 80e-3])
def test_bands_stay_bright_over_the_working_depth(depth: float) -> None:
    config, camera = make(
        **QUIET,
        **{
            "camera.camera_from_guide.translation": (0.028, 0.0, depth),
            "camera.camera_from_guide.rotation": (0.0, -np.pi / 2, 0.0),
        },
    )
    rendered = camera.draw(*bent(config, 0.0, 0.0, 0.0), 0)
    for u, v in rendered.true_features.reshape(2, 2):
        blue, green, red = rendered.image[round(v), round(u)].astype(float)
        assert 0.25 * 190 < green <= 255
        assert green > 1.3 * max(blue, red)
