"""Image disturbances of the simulated camera, in the order of the light path.

The order of the names in ``twin.disturb`` does not matter:

1. on the tissue, behind the instrument: stool;
2. on and in front of the instrument: highlights, debris;
3. in the air: smoke;
4. optics and exposure: touching (defocus), motion_blur, white_balance, exposure, partial (field
   stop);
5. sensor: clipping at 255, rounding, noise;
6. video processor: text, inset.

``no_instrument`` leaves the instrument out. Each disturbance varies smoothly over frames and is
seeded by (``twin.seed``, its name, frame number): the same seed gives the same bytes, whichever
others are active.

Ground truth: the true features are the centroids of the *whole* sides of the bands that face the
camera, including what is occluded or outside the image, as in the loop's model. No disturbance
changes them; the centroid of a visible part counts as measurement error. Disturbances that occlude
reduce the visible share; smoke, blur, exposure and colour do not.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.twin import obstacles, optics, overlays
from tautscope.twin.bands import Bands, Mask
from tautscope.twin.noise import TemporalNoise

Image = NDArray[np.uint8]


class Stage(IntEnum):
    """Stage of the light path at which a disturbance acts."""

    TISSUE = 0
    """Light (float32) from behind the instrument."""
    SCENE = 1
    """Light (float32) with the instrument, before the sensor."""
    OVERLAY = 2
    """Image (uint8) after the sensor."""


@dataclass(frozen=True, slots=True)
class Disturbance:
    """One entry of the table.

    Attributes:
        name: As in ``twin.disturb``.
        stage: Where it acts.
        apply: Maps (image, bands, noise) to (image, mask of the pixels that now occlude the
            scene); may modify the given image.
    """

    name: str
    stage: Stage
    apply: Callable[[Any, Bands, TemporalNoise], tuple[Any, Mask | None]]


TABLE = (
    Disturbance("stool", Stage.TISSUE, obstacles.stool),
    Disturbance("highlights", Stage.SCENE, obstacles.highlights),
    Disturbance("debris", Stage.SCENE, obstacles.debris),
    Disturbance("smoke", Stage.SCENE, obstacles.smoke),
    Disturbance("touching", Stage.SCENE, optics.defocus),
    Disturbance("motion_blur", Stage.SCENE, optics.motion_blur),
    Disturbance("white_balance", Stage.SCENE, optics.white_balance),
    Disturbance("exposure", Stage.SCENE, optics.exposure),
    Disturbance("partial", Stage.SCENE, optics.field_stop),
    Disturbance("text", Stage.OVERLAY, overlays.text),
    Disturbance("inset", Stage.OVERLAY, overlays.inset),
)
"""In the order of the light path; ``no_instrument`` has no entry, because it draws nothing."""

NO_INSTRUMENT = "no_instrument"


class Disturbances:
    """The active disturbances, in the order of `TABLE`.

    Args:
        names: ``twin.disturb``; duplicates have no effect.
        seed: ``twin.seed``.

    Attributes:
        is_active: Whether any disturbance is active.
        hides_instrument: Whether the instrument is left out.
    """

    def __init__(self, names: Sequence[str], seed: int) -> None:
        self._seed = seed
        self._active = [each for each in TABLE if each.name in names]
        self.hides_instrument = NO_INSTRUMENT in names
        self.is_active = bool(self._active) or self.hides_instrument

    def apply_to_background(self, background: Image, sequence: int) -> Image:
        """Apply those on the tissue to the background image."""
        if not self._has(Stage.TISSUE):
            return background
        no_bands = Bands.from_surface(np.empty((0, 5)))
        light = background.astype(np.float32)
        return quantize(self._run(Stage.TISSUE, light, no_bands, sequence)[0])

    def apply_to_scene(self, image: Image, bands: Bands, sequence: int) -> tuple[Image, Mask]:
        """Image on the sensor, before noise, and the mask of occluded pixels."""
        if not self._has(Stage.SCENE):
            return image, np.zeros(image.shape[:2], dtype=bool)
        light, hidden = self._run(Stage.SCENE, image.astype(np.float32), bands, sequence)
        return quantize(light), hidden

    def apply_to_output(self, image: Image, bands: Bands, sequence: int) -> tuple[Image, Mask]:
        """Image with the overlays of the video processor, and the mask of their pixels."""
        return self._run(Stage.OVERLAY, image, bands, sequence)

    def _has(self, stage: Stage) -> bool:
        return any(each.stage is stage for each in self._active)

    def _run(self, stage: Stage, image: Any, bands: Bands, sequence: int) -> tuple[Any, Mask]:
        hidden = np.zeros(image.shape[:2], dtype=bool)
        for each in self._active:
            if each.stage is stage:
                noise = TemporalNoise(self._seed, each.name, sequence)
                image, mask = each.apply(image, bands, noise)
                if mask is not None:
                    hidden |= mask
        return image, hidden


def quantize(light: NDArray[np.float32]) -> Image:
    """Convert light to grey levels: rounded, clipped at 0 and 255."""
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)
