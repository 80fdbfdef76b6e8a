"""What lens and exposure do to the light: defocus, motion blur, colour, exposure, field stop.

Pictures are light, as in `tautscope.twin.obstacles`.
"""

from __future__ import annotations

import cv2
import numpy as np

from tautscope.twin.drift import Bands, Drift, Floats, Light, Mask

STRONGEST_DEFOCUS = 5.0
"""Standard deviation of the spread function [px]."""
LONGEST_BLUR = 8.0
"""Way of the picture during the exposure [px]."""
EXPOSURES = 4.0
"""Largest factor on the light, and one over the smallest."""
GAINS = 1.25
"""Largest factor on a colour channel, and one over the smallest."""
STOPPED_SHARE = 0.45
"""Largest share of a band beyond the field stop."""


def touching(light: Light, _: Bands, drift: Drift) -> tuple[Light, Mask | None]:
    """Defocus of up to 5 px: bands that lie close to each other run into one."""
    sigma = STRONGEST_DEFOCUS * (0.55 + 0.45 * drift.wander("sigma", 60))
    return np.asarray(cv2.GaussianBlur(light, (0, 0), sigma), dtype=np.float32), None


def motion_blur(light: Light, _: Bands, drift: Drift) -> tuple[Light, Mask | None]:
    """The picture moves on a straight line of up to 8 px while it is exposed, half of it before
    and half after the time of capture, so that no centroid moves.
    """  # noqa: D205
    length = LONGEST_BLUR * (0.5 + 0.5 * drift.wander("length", 30))
    angle = np.pi * drift.wander("angle", 60)
    kernel = _line(length, angle)
    border = cv2.BORDER_REPLICATE
    return np.asarray(cv2.filter2D(light, -1, kernel, borderType=border), dtype=np.float32), None


def _line(length: float, angle: float) -> Light:
    """Weights of a line through the middle, each of its points shared between four pixels."""
    half = int(np.ceil(length / 2)) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1))
    way = np.linspace(-length / 2, length / 2, 65)
    for x, y in zip(half + way * np.cos(angle), half + way * np.sin(angle), strict=True):
        column, row = int(x), int(y)
        right, down = x - column, y - row
        kernel[row : row + 2, column : column + 2] += np.outer([1 - down, down], [1 - right, right])
    return np.asarray(kernel / kernel.sum(), dtype=np.float32)


def white_balance(light: Light, _: Bands, drift: Drift) -> tuple[Light, Mask | None]:
    """A gain of 0.8 to 1.25 on each colour channel."""
    gains = [GAINS ** drift.wander(channel, 70) for channel in ("blue", "green", "red")]
    return light * np.array(gains, dtype=np.float32), None


def exposure(light: Light, _: Bands, drift: Drift) -> tuple[Light, Mask | None]:
    """All grey levels times 0.25 to 4; what exceeds 255 afterwards is clipped by the sensor."""
    return light * np.float32(EXPOSURES ** drift.wander("gain", 50)), None


def partial(light: Light, bands: Bands, drift: Drift) -> tuple[Light, Mask | None]:
    """The black edge of an octagonal picture moves in until up to 45 % of a band is beyond it.

    Of the eight edges and two bands, the pair that needs the least travel. The camera's geometry
    stays as it is, so that the loop's model still holds.
    """
    drawn = bands.drawn()
    number, level = drift.episode("stop", 150)
    if not drawn:
        return light, None
    # First from the picture's border to the band, then over it.
    come, over = min(1.0, 2 * level), max(0.0, 2 * level - 1)
    height, width = light.shape[:2]
    share = STOPPED_SHARE * over * drift.generator("stop", number).uniform(0.4, 1.0)
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]], dtype=np.float64)
    best: tuple[float, Floats, float] | None = None
    for turn in np.arange(8) * np.pi / 4:
        inwards = -np.array([np.cos(turn), np.sin(turn)])
        border = float((corners @ inwards).min())
        for k in drawn:
            # The place along the way at which the edge has passed the wanted share.
            mine = bands.band == k
            along = bands.at[mine] @ inwards
            order = np.argsort(along)
            passed = np.cumsum(bands.area[mine][order]) / bands.area[mine].sum()
            place = float(along[order][np.searchsorted(passed, share)])
            if best is None or place - border < best[0]:
                best = (place - border, inwards, place)
    assert best is not None
    travel, inwards, place = best
    place -= (1 - come) * travel
    x, y = np.arange(width), np.arange(height)
    distance = inwards[0] * x[None, :] + inwards[1] * y[:, None] - place
    inside = np.clip(0.5 + distance / 1.5, 0, 1).astype(np.float32)[..., None]
    return light * inside, np.asarray(distance < 0)
