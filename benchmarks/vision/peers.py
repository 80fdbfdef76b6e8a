"""Detectors of coloured regions for comparison: OpenCV, scikit-image, ViSP.

Each finds the centroids of the regions in a B, G, R frame and returns the number of large ones;
ViSP tracks one.
"""

import shutil
import subprocess
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from tautscope.config import Config
from tautscope.loop.vision import Region

try:
    from skimage import filters, measure
except ImportError:
    measure = filters = None

Image = NDArray[np.uint8]
MINIMUM_AREA = 40
HAS_SCIKIT_IMAGE = measure is not None


def opencv_textbook(image: Image, config: Config) -> int:
    blurred = cv2.GaussianBlur(image, (3, 3), 0)
    projected = cv2.transform(blurred, np.array([config.vision.weights]))
    _, mask = cv2.threshold(projected, config.vision.threshold, 255, cv2.THRESH_BINARY)
    return _by_components(mask)


def _projected(image: Image, config: Config) -> Image:
    projected = cv2.transform(image, np.array([config.vision.weights], np.float32))
    return cv2.GaussianBlur(projected, (3, 3), 0)


def _by_contours(mask: Image) -> int:
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return sum(cv2.moments(contour)["m00"] >= MINIMUM_AREA for contour in contours)


def _by_components(mask: Image) -> int:
    count, _, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    return int((stats[1:count, cv2.CC_STAT_AREA] >= MINIMUM_AREA).sum())


def _thresholded(image: Image, config: Config) -> Image:
    return cv2.threshold(
        _projected(image, config), config.vision.threshold, 255, cv2.THRESH_BINARY
    )[1]


def opencv_contours(image: Image, config: Config) -> int:
    return _by_contours(_thresholded(image, config))


def opencv_components(image: Image, config: Config) -> int:
    return _by_components(_thresholded(image, config))


def opencv_planes(image: Image, config: Config) -> int:
    """Weight the channels separately, in saturating 8-bit arithmetic."""
    blue, green, red = cv2.split(image)
    weights = config.vision.weights
    other = cv2.addWeighted(blue, -weights[0], red, -weights[2], 0)
    projected = cv2.blur(cv2.subtract(green, other), (3, 3))
    mask = cv2.threshold(projected, config.vision.threshold, 255, cv2.THRESH_BINARY)[1]
    return _by_contours(mask)


def scikit_image(image: Image, config: Config) -> int:
    projected = image @ np.array(config.vision.weights, np.float32)
    mask = filters.gaussian(projected, 0.7, preserve_range=True) > config.vision.threshold
    table = measure.regionprops_table(measure.label(mask), properties=("area", "centroid"))
    return int((table["area"] >= MINIMUM_AREA).sum())


class Visp:
    """Program that tracks one blob with vpDot2; compiled if the headers are installed."""

    def __init__(self, folder: Path) -> None:
        self.program = folder / "visp_dot"
        self.missing = ""
        flags = ["-I/usr/include/eigen3", "-lvisp_blob", "-lvisp_core"]
        source = Path(__file__).with_name("visp_dot.cpp")
        if shutil.which("c++") is None:
            self.missing = "no C++ compiler"
        elif not [*Path("/usr/include").glob("**/visp3/blob/vpDot2.h")]:
            self.missing = "ViSP is not installed (Debian: libvisp-dev)"
        else:
            command = ["c++", "-O2", "-o", str(self.program), str(source), *flags]
            built = subprocess.run(command, capture_output=True, text=True, check=False)
            if built.returncode:
                self.missing = "visp_dot.cpp does not compile: " + built.stderr.strip()[:200]

    def microseconds(self, image: Image, regions: tuple[Region, ...], repeats: int) -> float | None:
        """Return the time to track the first region [us]; None if ViSP is missing."""
        if self.missing or not regions:
            return None
        height, width = image.shape[:2]
        u, v, box_width, box_height = regions[0].box
        grey = np.zeros((height, width), np.uint8)
        centre = (u + box_width // 2, v + box_height // 2)
        cv2.ellipse(grey, centre, (box_width // 2, box_height // 2), 0, 0, 360, 255, cv2.FILLED)
        file = self.program.with_name("grey.raw")
        grey.tofile(file)
        numbers = [width, height, *centre, repeats]
        command = [str(self.program), str(file), *map(str, numbers)]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        if run.returncode:
            self.missing = "vpDot2 fails: " + run.stderr.strip()[:200]
            return None
        return float(run.stdout.split()[0])
