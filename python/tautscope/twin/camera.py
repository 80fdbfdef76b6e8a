"""The twin's camera: a picture of the instrument from the frames along its centreline.

Nothing here knows bending angles or the loop's camera model: the physics says where the
centreline is, and `Renderer` (crates/render) projects and draws the tube around it by itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope._core import Renderer
from tautscope.config import Config
from tautscope.errors import FieldError
from tautscope.twin.disturbances import Disturbances
from tautscope.twin.drift import Bands
from tautscope.twin.tissue import load_backgrounds, mucosa

FRAMES_PER_BACKGROUND = 25
"""Pictures after which the next image of the background folder is shown."""


@dataclass(frozen=True, slots=True)
class Picture:
    """One picture and the truth about it.

    Attributes:
        image: Pixels, uint8 (height, width, 3), BGR.
        true_features: (4,) [px] u and v of the centroids of bands A and B: the mean place, by area
            in the picture, of the side of the band that faces the camera, *all* of it, also what
            is outside the picture or hidden; what an ideal segmentation would measure were it
            all visible. Pixel centres are at whole numbers. NaN for a band of which nothing is
            visible.
        true_visible: (2,) share of that side of A and of B that is inside the picture and hidden
            neither by the instrument nor by a disturbance, by area in the picture, 0 to 1.
    """

    image: NDArray[np.uint8]
    true_features: NDArray[np.float64]
    true_visible: NDArray[np.float64]


class TwinCamera:
    """Draws what the endoscope's camera sees.

    Pinhole with OpenCV's distortion, Eq. (8), as ``config.camera`` has it; two light guides beside
    the lens; Lambert's diffuse and Blinn and Phong's specular reflection; Gaussian sensor noise of
    standard deviation ``config.twin.image_noise`` [grey levels], rounded to whole levels. The same
    ``config.twin.seed`` and sequence number give the same bytes, in whatever order pictures are
    drawn.

    With ``config.twin.disturb``, disturbances act between tissue, lens, sensor and video processor;
    `tautscope.twin.disturbances` has their order and what they do to the truth.

    Wrong where: parts nearer than 2 mm to the camera are left out; tissue is a flat picture behind
    the instrument, which throws no shadow on it; grey levels are proportional to light (no gamma).

    Args:
        config: camera, instrument and twin are read.

    Raises:
        ConfigError: A value from which no camera can be made.
        MissingPathError: ``twin.background`` is no folder with a readable image.
    """

    def __init__(self, config: Config) -> None:
        camera, instrument, twin = config.camera, config.instrument, config.twin
        self._renderer = Renderer(
            size=(camera.width, camera.height),
            focal=(camera.fx, camera.fy),
            centre=(camera.cx, camera.cy),
            distortion=camera.distortion,
            translation=camera.camera_from_guide.translation,
            rotation=camera.camera_from_guide.rotation,
            diameter=instrument.diameter,
            bending_length=instrument.bending_length,
            tip_length=instrument.tip_length,
            markers=(instrument.marker_a, instrument.marker_b),
            band_length=instrument.band_length,
            noise=twin.image_noise,
            seed=twin.seed % 2**64,
        )
        self._disturbances = Disturbances(twin.disturb, twin.seed)
        if twin.background is None:
            self._backgrounds = [mucosa(camera.width, camera.height, twin.seed)]
        else:
            self._backgrounds = load_backgrounds(twin.background, camera.width, camera.height)

    def draw(self, points: ArrayLike, directions: ArrayLike, sequence: int) -> Picture:
        """Draw the instrument along the frames of its centreline.

        Consecutive frames are joined by cubic Hermite pieces with tangents as long as the chord:
        p(t) = h00(t) p0 + h10(t) |p1 - p0| d0 + h01(t) p1 + h11(t) |p1 - p0| d1. Straight frames
        give straight pieces; an arc of angle a is met to within its radius times a^4 / 128.

        Args:
            points: (n, 3) [m] places on the centreline in the guide's frame (z along the channel
                outwards, origin where the instrument leaves the guide), proximal to distal, n at
                least 2. The last is the distal end of the tip. Numbers that are not finite give a
                picture without instrument.
            directions: (n, 3) tangents at the points, towards the tip, in the guide's frame.
            sequence: Number of the picture, 0 or more: chooses the noise, the background and the
                state of the disturbances.

        Raises:
            FieldError: An array of the wrong shape, or a negative sequence number.
        """
        places = _frames("points", points)
        tangents = _frames("directions", directions)
        if places.shape != tangents.shape:
            raise FieldError("directions", tangents.shape, f"as many as points, {places.shape}")
        if not 0 <= sequence < 2**63:
            raise FieldError("sequence", sequence, "a whole number from 0 to 2^63 - 1")
        shown = sequence // FRAMES_PER_BACKGROUND % len(self._backgrounds)
        background = self._backgrounds[shown]
        if self._disturbances.any:
            return self._disturbed(background, places, tangents, sequence)
        return Picture(*self._renderer.draw(background, places, tangents, sequence))

    def _disturbed(
        self,
        background: NDArray[np.uint8],
        places: NDArray[np.float64],
        tangents: NDArray[np.float64],
        sequence: int,
    ) -> Picture:
        disturb = self._disturbances
        if disturb.no_instrument:
            places = np.full_like(places, np.nan)
        tissue = disturb.on_tissue(background, sequence)
        drawn, features, _, surface = self._renderer.draw_scene(tissue, places, tangents)
        bands = Bands.from_surface(surface)
        image, hidden = disturb.on_light(drawn, bands, sequence)
        self._renderer.add_noise(image, sequence)
        image, written = disturb.on_video(image, bands, sequence)
        visible = bands.visible(hidden | written)
        features[np.repeat(visible, 2) == 0] = np.nan
        return Picture(image, features, visible)


def _frames(field: str, values: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 2 or array.shape[0] < 2 or array.shape[1] != 3:
        raise FieldError(field, array.shape, "an array (n, 3) with n at least 2")
    return array
