"""Calibrate the marker colour on your rig: from images and masks to section [vision] of the TOML.

``uv run python examples/fit_colour.py frame.png mask.png``: the mask is white on the bands, black
elsewhere, and grey where pixels are to be ignored (edges of the bands). Several pairs are allowed.
Without files, an image of the simulated instrument is used.
"""

from __future__ import annotations

import sys

import cv2
import numpy as np
from numpy.typing import NDArray
from tautscope import Twin, load_config
from tautscope.calibration.colour import ColorDiscriminant

Pixels = NDArray[np.uint8]


def labelled_pixels(frame_file: str, mask_file: str) -> tuple[Pixels, Pixels]:
    """Pixels of the bands and of the background, (n, 3) B, G, R."""
    frame, mask = cv2.imread(frame_file), cv2.imread(mask_file, cv2.IMREAD_GRAYSCALE)
    if frame is None or mask is None or frame.shape[:2] != mask.shape:
        raise SystemExit(f"{frame_file}, {mask_file}: two images of the same size are needed")
    return frame[mask > 250], frame[mask < 5]


def simulated_pixels() -> tuple[Pixels, Pixels]:
    """Pixels near the true centres of the bands and far from them, of a simulated image."""
    twin = Twin(load_config())
    sample = twin.reset()
    while sample.frame is None or sample.frame.true_features is None:
        sample = twin.step(sample.applied)
    frame, centres = sample.frame.image, sample.frame.true_features.reshape(2, 2)
    v, u = np.indices(frame.shape[:2])
    distance = np.min([np.hypot(u - x, v - y) for x, y in centres], axis=0)
    return frame[distance < 4], frame[distance > 80]


def main() -> None:
    files = sys.argv[1:]
    pairs = list(zip(files[::2], files[1::2], strict=True))
    labelled = [labelled_pixels(*pair) for pair in pairs] or [simulated_pixels()]
    bands, background = (np.concatenate(pixels) for pixels in zip(*labelled, strict=True))
    colour = ColorDiscriminant.fit(bands, background)
    print("[vision]")
    print(f"weights = [{', '.join(f'{weight:.3f}' for weight in colour.weights)}]")
    print(f"threshold = {colour.threshold:.1f}")
    hits, errors = (100 * colour.is_marker(pixels).mean() for pixels in (bands, background))
    print(f"# classified as marker: {hits:.1f} % of the bands, {errors:.2f} % of the background")


if __name__ == "__main__":
    main()
