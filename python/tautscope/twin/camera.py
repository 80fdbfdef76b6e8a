"""The simulated camera: renders the instrument from points and tangents along its centreline.

It uses neither bending angles nor the loop's camera model: the physics gives the centreline, and
`Renderer` (crates/render) has its own projection.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tautscope._core import Renderer
from tautscope.config import CameraConfig, Config
from tautscope.errors import ConfigError, FieldError
from tautscope.twin.bands import Bands
from tautscope.twin.disturbances import NO_INSTRUMENT, Stage, disturbed
from tautscope.twin.sensor import AutomaticExposure, Centreline, compress
from tautscope.twin.tissue import draw_mucosa, load_backgrounds

FRAMES_PER_BACKGROUND = 25
"""Number of frames after which the next image of the background folder is shown."""
_NO_BANDS = Bands.from_surface(np.empty((0, 5)))


def check_pixel_format(camera: CameraConfig) -> None:
    """Refuse a camera whose images are not B, G, R, with a `ConfigError`."""
    if camera.pixel_format != "bgr":
        raise ConfigError("camera.pixel_format", camera.pixel_format, "bgr, for simulated images")


@dataclass(frozen=True, slots=True, eq=False)
class RenderedImage:
    """A rendered image with its ground truth.

    Attributes:
        image: Pixels, uint8 (height, width, 3), BGR.
        true_features: (4,) [px] u and v of bands A and B: centroid, by area in the image, of the
            *whole* side of the band that faces the camera, including what is outside the image or
            occluded. Pixel centres are at integers. NaN for a band of which nothing is visible.
        true_visible: (2,) share of that side of A and of B, by area in the image, that is inside
            the image and occluded neither by the instrument nor by a disturbance, 0 to 1.
    """

    image: NDArray[np.uint8]
    true_features: NDArray[np.float64]
    true_visible: NDArray[np.float64]


class TwinCamera:
    """Renders the image of the endoscope's camera.

    Pinhole with OpenCV's distortion, Eq. (8), from ``config.camera``; two light guides beside the
    lens; Lambertian diffuse and Blinn-Phong specular reflection; Gaussian sensor noise of standard
    deviation ``config.twin.image_noise`` [grey levels], rounded to integers. The same
    ``config.twin.seed`` and frame number give the same bytes, in whatever order frames are drawn,
    except with automatic exposure, which depends on the frames before. ``config.twin.sensor``
    describes exposure, rolling shutter and compression.
    The disturbances of ``config.twin.disturb`` are described in `tautscope.twin.disturbances`.

    Wrong when parts are nearer than 2 mm to the camera (they are left out), when the instrument
    casts a shadow (tissue is a flat background), or when the camera has a gamma (grey levels are
    proportional to light).

    Raises:
        ConfigError: A value is invalid for the renderer.
        MissingPathError: ``twin.background`` is not a folder with a readable image.
    """

    def __init__(self, config: Config) -> None:
        camera, instrument, twin = config.camera, config.instrument, config.twin
        check_pixel_format(camera)
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
        self._twin = twin
        self.reset()
        self._is_processed = (
            bool(twin.disturb)
            or twin.sensor.exposure_time_constant > 0
            or twin.sensor.jpeg_quality is not None
        )
        if twin.background is None:
            self._backgrounds = [draw_mucosa(camera.width, camera.height, twin.seed)]
        else:
            self._backgrounds = load_backgrounds(twin.background, camera.width, camera.height)

    def reset(self) -> None:
        """Return to the exposure at the start of a run."""
        self._exposure = AutomaticExposure(self._twin)

    def draw(self, points: ArrayLike, directions: ArrayLike, sequence: int) -> RenderedImage:
        """Draw the instrument along its centreline.

        Consecutive points are joined by cubic Hermite splines with tangents as long as the chord:
        p(t) = h00(t) p0 + h10(t) |p1 - p0| d0 + h01(t) p1 + h11(t) |p1 - p0| d1. An arc of angle a
        is approximated to within its radius times a^4 / 128.

        Args:
            points: (n, 3) [m] points of the centreline in the guide's frame (z along the channel,
                outwards; origin where the instrument leaves the guide), proximal to distal, n at
                least 2. The last is the distal end of the tip. Values that are not finite give an
                image without instrument.
            directions: (n, 3) tangents at the points, towards the tip, in the guide's frame.
            sequence: Frame number, 0 or more; selects noise, background and disturbances.

        Raises:
            FieldError: An array has the wrong shape, or the frame number is negative.
        """
        centres = _checked("points", points)
        tangents = _checked("directions", directions)
        if centres.shape != tangents.shape:
            raise FieldError("directions", tangents.shape, f"as many as points, {centres.shape}")
        return self.draw_strips([(centres, tangents)], sequence)

    def draw_strips(self, strips: Sequence[Centreline], sequence: int) -> RenderedImage:
        """Draw each strip of rows of equal height, from the top, with a centreline of its own.

        The ground truth is that of the middle one.

        Raises:
            FieldError: The frame number is negative.
        """
        if not 0 <= sequence < 2**63:
            raise FieldError("sequence", sequence, "a whole number from 0 to 2^63 - 1")
        background = self._backgrounds[sequence // FRAMES_PER_BACKGROUND % len(self._backgrounds)]
        if len(strips) == 1 and not self._is_processed:
            return RenderedImage(*self._renderer.draw(background, *strips[0], sequence))
        if NO_INSTRUMENT in self._twin.disturb:
            strips = [(np.full_like(points, np.nan), tangents) for points, tangents in strips]
        tissue, _ = disturbed(self._twin, Stage.TISSUE, background, _NO_BANDS, sequence)
        middle = len(strips) // 2
        drawn, features, visible, surface = self._renderer.draw_scene(tissue, *strips[middle])
        edges = np.linspace(0, len(drawn), len(strips) + 1).round().astype(int).tolist()
        for k, strip in enumerate(strips):
            if k != middle:
                self._renderer.draw_rows(tissue, *strip, drawn, edges[k : k + 2])
        bands = Bands.from_surface(surface)
        image, hidden = disturbed(self._twin, Stage.SCENE, drawn, bands, sequence)
        image = self._exposure.expose(image)
        self._renderer.add_noise(image, sequence)
        image, overlaid = disturbed(self._twin, Stage.OVERLAY, image, bands, sequence)
        image = compress(image, self._twin.sensor.jpeg_quality)
        if self._twin.disturb:
            visible = bands.visible_shares(hidden | overlaid)
            features[np.repeat(visible, 2) == 0] = np.nan
        return RenderedImage(image, features, visible)


def _checked(field: str, values: ArrayLike) -> NDArray[np.float64]:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 2 or array.shape[0] < 2 or array.shape[1] != 3:
        raise FieldError(field, array.shape, "an array (n, 3) with n at least 2")
    return array
