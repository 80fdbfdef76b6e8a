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

from collections.abc import Callable
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.config import TwinConfig
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


Apply = Callable[[Any, Bands, TemporalNoise], tuple[Any, Mask | None]]
"""Maps (image, bands, noise) to (image, mask of the pixels that now occlude the scene); may modify
the given image."""

TABLE: dict[str, tuple[Stage, Apply]] = {
    "stool": (Stage.TISSUE, obstacles.stool),
    "highlights": (Stage.SCENE, obstacles.highlights),
    "debris": (Stage.SCENE, obstacles.debris),
    "smoke": (Stage.SCENE, obstacles.smoke),
    "touching": (Stage.SCENE, optics.defocus),
    "motion_blur": (Stage.SCENE, optics.motion_blur),
    "white_balance": (Stage.SCENE, optics.white_balance),
    "exposure": (Stage.SCENE, optics.exposure),
    "partial": (Stage.SCENE, optics.field_stop),
    "text": (Stage.OVERLAY, overlays.text),
    "inset": (Stage.OVERLAY, overlays.inset),
}
"""In the order of the light path; ``no_instrument`` has no entry, because it draws nothing."""

NO_INSTRUMENT = "no_instrument"


def disturbed(
    twin: TwinConfig, stage: Stage, image: Image, bands: Bands, sequence: int
) -> tuple[Image, Mask]:
    """The image after the disturbances of a stage, and the mask of the pixels that they occlude."""
    hidden = np.zeros(image.shape[:2], dtype=bool)
    active = [
        (name, apply) for name, (at, apply) in TABLE.items() if at is stage and name in twin.disturb
    ]
    if not active:
        return image, hidden
    is_light = stage is not Stage.OVERLAY
    changed: Any = image.astype(np.float32) if is_light else image
    for name, apply in active:
        changed, mask = apply(changed, bands, TemporalNoise(twin.seed, name, sequence))
        if mask is not None:
            hidden |= mask
    return np.clip(np.rint(changed), 0, 255).astype(np.uint8) if is_light else changed, hidden
