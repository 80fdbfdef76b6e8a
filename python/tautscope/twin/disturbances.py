"""Disturbances of the twin's pictures: the table of them, and the order in which they act.

Light goes from the tissue past the instrument, through smoke and lens, to the sensor, and the
video processor writes over what the sensor gives. So, whatever order the names come in:

1. on the tissue, behind the instrument: stool;
2. on and before the instrument: highlights, debris;
3. in the air: smoke;
4. in the lens and the exposure: touching (defocus), motion_blur, white_balance, exposure, partial
   (field stop);
5. the sensor: clipping at 255, rounding, noise;
6. in the video processor: text, inset.

``no_instrument`` leaves the instrument out. Each varies smoothly over pictures, seeded by
(``twin.seed``, its name, sequence number): the same seed gives the same bytes, whatever else is on.

Truth: no disturbance moves a band, so none changes the true features; they are the centroid of the
*whole* near side of the band, also of what debris, highlights, overlays, the field stop, the
picture's border or the instrument itself hide. That is what the loop's model predicts: the centroid
of the piece that is left is off it, and counts as error. What disturbances change is the visible
share. Smoke, blur, exposure and colour hide nothing in that sense.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.twin import obstacles, optics, overlays
from tautscope.twin.drift import Bands, Drift, Mask


class Stage(IntEnum):
    """Where in the way of the light a disturbance acts."""

    TISSUE = 0
    """float32 light behind the instrument."""
    LIGHT = 1
    """float32 light with the instrument, before the sensor."""
    OVERLAY = 2
    """uint8 picture after the sensor."""


@dataclass(frozen=True, slots=True)
class Disturbance:
    """One entry of the table.

    Attributes:
        name: As in ``twin.disturb``.
        stage: Where it acts.
        apply: (picture, bands, drift) to (picture, which pixels now hide what is behind them);
            may write into the picture it is given.
    """

    name: str
    stage: Stage
    apply: Callable[[Any, Bands, Drift], tuple[Any, Mask | None]]


TABLE = (
    Disturbance("stool", Stage.TISSUE, obstacles.stool),
    Disturbance("highlights", Stage.LIGHT, obstacles.highlights),
    Disturbance("debris", Stage.LIGHT, obstacles.debris),
    Disturbance("smoke", Stage.LIGHT, obstacles.smoke),
    Disturbance("touching", Stage.LIGHT, optics.touching),
    Disturbance("motion_blur", Stage.LIGHT, optics.motion_blur),
    Disturbance("white_balance", Stage.LIGHT, optics.white_balance),
    Disturbance("exposure", Stage.LIGHT, optics.exposure),
    Disturbance("partial", Stage.LIGHT, optics.partial),
    Disturbance("text", Stage.OVERLAY, overlays.text),
    Disturbance("inset", Stage.OVERLAY, overlays.inset),
)
"""In the order of the light's way. ``no_instrument`` draws nothing and so is not in it."""

EMPTY = "no_instrument"


class Disturbances:
    """Those that are switched on, in the order of the table.

    Args:
        names: ``twin.disturb``, which the configuration has checked; twice is once.
        seed: ``twin.seed``.

    Attributes:
        any: Whether there is anything to do.
        no_instrument: Whether the instrument is left out.
    """

    def __init__(self, names: Sequence[str], seed: int) -> None:
        self._seed = seed
        self._active = [each for each in TABLE if each.name in names]
        self.no_instrument = EMPTY in names
        self.any = bool(self._active) or self.no_instrument

    def on_tissue(self, background: NDArray[np.uint8], sequence: int) -> NDArray[np.uint8]:
        """The background with what sticks to it."""
        if not any(each.stage is Stage.TISSUE for each in self._active):
            return background
        nothing = Bands.from_surface(np.empty((0, 5)))
        light = background.astype(np.float32)
        return sensed(self._run(Stage.TISSUE, light, nothing, sequence)[0])

    def on_light(
        self, image: NDArray[np.uint8], bands: Bands, sequence: int
    ) -> tuple[NDArray[np.uint8], Mask]:
        """The drawn scene as it is on the sensor, before noise, and which pixels hide it."""
        light, hidden = self._run(Stage.LIGHT, image.astype(np.float32), bands, sequence)
        return sensed(light), hidden

    def on_video(
        self, image: NDArray[np.uint8], bands: Bands, sequence: int
    ) -> tuple[NDArray[np.uint8], Mask]:
        """The sensor's picture with what is written over it, and which pixels that is."""
        return self._run(Stage.OVERLAY, image, bands, sequence)

    def _run(self, stage: Stage, picture: Any, bands: Bands, sequence: int) -> tuple[Any, Mask]:
        hidden = np.zeros(picture.shape[:2], dtype=bool)
        for each in self._active:
            if each.stage is stage:
                drift = Drift(self._seed, each.name, sequence)
                picture, mask = each.apply(picture, bands, drift)
                if mask is not None:
                    hidden |= mask
        return picture, hidden


def sensed(light: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Light to grey levels: rounded, clipped at 0 and 255."""
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)
