"""Automatic exposure and compression of the camera's images, and the rows of a rolling shutter."""

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.config import TwinConfig

Image = NDArray[np.uint8]
Floats = NDArray[np.float64]
Centreline = tuple[Floats, Floats]

LARGEST_GAIN = 3.0
"""Largest gain of the automatic exposure; the smallest is its inverse."""
STRIP_TRAVEL = 5e-5
"""Travel of the instrument within a strip of rows that are drawn as captured at once [m]; about
0.7 px where the instrument is near."""
MOST_STRIPS = 16


class AutomaticExposure:
    """Gain on the light by which the mean grey level follows a target.

    From one frame to the next, with the mean of the image given out,

        gain <- gain (target / mean)^(1 - exp(-frame period / time constant))

    Wrong when the sensor has saturated: light above 255 is lost before the gain.
    """

    def __init__(self, config: TwinConfig) -> None:
        time_constant = config.sensor.exposure_time_constant
        self._target = config.sensor.exposure_target
        self._share = -math.expm1(-1 / (config.frame_rate * time_constant)) if time_constant else 0
        self.gain = 1.0

    def expose(self, image: Image) -> Image:
        """The image with this gain; sets the gain of the next frame."""
        if not self._share:
            return image
        exposed = cv2.convertScaleAbs(image, alpha=self.gain)
        mean = max(sum(cv2.sumElems(exposed)) / exposed.size, 1.0)
        gain = self.gain * (self._target / mean) ** self._share
        self.gain = min(max(gain, 1 / LARGEST_GAIN), LARGEST_GAIN)
        return np.asarray(exposed, dtype=np.uint8)


def compress(image: Image, quality: int | None) -> Image:
    """The image after JPEG compression with half the colour resolution along rows (4:2:2)."""
    if quality is None:
        return image
    sampling = [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_422]
    _, packed = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality, *sampling])
    return np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR), dtype=np.uint8)


class Readout:
    """Centrelines during the readout of an image with a rolling shutter.

    Args:
        readout: Time from the capture of the first to that of the last row [s].
    """

    def __init__(self, readout: float) -> None:
        self._readout = readout
        self._past: list[tuple[float, Centreline]] = []

    def add(self, time: float, centreline: Centreline) -> None:
        """Add the present centreline, and forget those before the readout."""
        self._past.append((time, centreline))
        while len(self._past) > 2 and self._past[1][0] <= time - self._readout:
            self._past.pop(0)

    def strips(self) -> list[Centreline]:
        """Centrelines of strips of rows of equal height, from the top.

        The last row is captured now. Each centreline is that of the middle of its strip, linearly
        interpolated. Their number grows with the motion, and is odd, so that the middle strip is
        captured at the middle of the readout.
        """
        now, (points, _) = self._past[-1]
        start = now - self._readout
        moved = float(np.abs(points - self._at(start)[0]).max())
        count = min(int(moved / STRIP_TRAVEL), MOST_STRIPS) // 2 * 2 + 1
        return [self._at(start + (k + 0.5) / count * self._readout) for k in range(count)]

    def _at(self, time: float) -> Centreline:
        if len(self._past) == 1:
            return self._past[0][1]
        times = [each for each, _ in self._past]
        after = min(max(int(np.searchsorted(times, time)), 1), len(times) - 1)
        (t0, first), (t1, second) = self._past[after - 1], self._past[after]
        share = min(max((time - t0) / (t1 - t0), 0.0), 1.0)
        points, tangents = (a + share * (b - a) for a, b in zip(first, second, strict=True))
        return points, tangents
