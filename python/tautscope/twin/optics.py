"""Image disturbances in the optics: defocus, motion blur, white balance, exposure, field stop.

Images are as in `tautscope.twin.obstacles`.
"""

import cv2
import numpy as np

from tautscope.twin.bands import Bands, Floats
from tautscope.twin.noise import TemporalNoise
from tautscope.twin.obstacles import Disturbed, LinearImage

MAX_DEFOCUS = 5.0
"""Standard deviation of the Gaussian point spread function [px]."""
MAX_BLUR = 8.0
"""Length of the motion blur [px]."""
MAX_EXPOSURE = 4.0
"""Largest exposure factor; the smallest is its inverse."""
MAX_GAIN = 1.25
"""Largest gain of a colour channel; the smallest is its inverse."""
MAX_STOPPED_SHARE = 0.45
"""Largest share of a band behind the field stop."""


def defocus(light: LinearImage, _: Bands, noise: TemporalNoise) -> Disturbed:
    """Gaussian blur with a standard deviation of up to 5 px; bands close together merge."""
    sigma = MAX_DEFOCUS * (0.55 + 0.45 * noise.scalar("sigma", 60))
    return np.asarray(cv2.GaussianBlur(light, (0, 0), sigma), dtype=np.float32), None


def motion_blur(light: LinearImage, _: Bands, noise: TemporalNoise) -> Disturbed:
    """Straight motion blur of up to 8 px, centred on the time of capture: no centroid moves."""
    length = MAX_BLUR * (0.5 + 0.5 * noise.scalar("length", 30))
    angle = np.pi * noise.scalar("angle", 60)
    kernel = _line_kernel(length, angle)
    border = cv2.BORDER_REPLICATE
    return np.asarray(cv2.filter2D(light, -1, kernel, borderType=border), dtype=np.float32), None


def _line_kernel(length: float, angle: float) -> LinearImage:
    """Kernel of a centred line; each of its points is distributed bilinearly over four pixels."""
    half = int(np.ceil(length / 2)) + 1
    kernel = np.zeros((2 * half + 1, 2 * half + 1))
    offsets = np.linspace(-length / 2, length / 2, 65)
    for x, y in zip(half + offsets * np.cos(angle), half + offsets * np.sin(angle), strict=True):
        column, row = int(x), int(y)
        right, down = x - column, y - row
        kernel[row : row + 2, column : column + 2] += np.outer([1 - down, down], [1 - right, right])
    return np.asarray(kernel / kernel.sum(), dtype=np.float32)


def white_balance(light: LinearImage, _: Bands, noise: TemporalNoise) -> Disturbed:
    """A gain of 0.8 to 1.25 per colour channel."""
    gains = [MAX_GAIN ** noise.scalar(channel, 70) for channel in ("blue", "green", "red")]
    return light * np.array(gains, dtype=np.float32), None


def exposure(light: LinearImage, _: Bands, noise: TemporalNoise) -> Disturbed:
    """A factor of 0.25 to 4 on the light; the sensor then clips at 255."""
    return light * np.float32(MAX_EXPOSURE ** noise.scalar("gain", 50)), None


def field_stop(light: LinearImage, bands: Bands, noise: TemporalNoise) -> Disturbed:
    """An edge of an octagonal field stop moves in until it hides up to 45 % of a band.

    Of the eight edges and two bands, the pair with the shortest travel is taken. The projection
    does not change.
    """
    visible = bands.visible_bands()
    number, level = noise.episode("stop", 150)
    if not visible:
        return light, None
    # First from the image border to the band, then over the band.
    approach, coverage = min(1.0, 2 * level), max(0.0, 2 * level - 1)
    height, width = light.shape[:2]
    share = MAX_STOPPED_SHARE * coverage * noise.generator("stop", number).uniform(0.4, 1.0)
    corners = np.array([[0, 0], [width, 0], [0, height], [width, height]], dtype=np.float64)
    best: tuple[float, Floats, float] | None = None
    for turn in np.arange(8) * np.pi / 4:
        inwards = -np.array([np.cos(turn), np.sin(turn)])
        border = float((corners @ inwards).min())
        for k in visible:
            # Position of the edge at which it hides the wanted share.
            mine = bands.band == k
            along = bands.pixels[mine] @ inwards
            order = np.argsort(along)
            passed = np.cumsum(bands.area[mine][order]) / bands.area[mine].sum()
            position = float(along[order][np.searchsorted(passed, share)])
            if best is None or position - border < best[0]:
                best = (position - border, inwards, position)
    assert best is not None
    travel, inwards, position = best
    position -= (1 - approach) * travel
    x, y = np.arange(width), np.arange(height)
    distance = inwards[0] * x[None, :] + inwards[1] * y[:, None] - position
    inside = np.clip(0.5 + distance / 1.5, 0, 1).astype(np.float32)[..., None]
    return light * inside, np.asarray(distance < 0)
