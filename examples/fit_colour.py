"""The markers' colour on your rig: from a frame and a mask of it to a section of the configuration.

``uv run python examples/fit_colour.py frame.png mask.png``: the mask is white where a band is,
black where none is, grey where you do not care (the bands' edges). Several pairs may follow each
other. Without files, a frame of the simulated instrument.
"""

from __future__ import annotations

import sys

import cv2
import numpy as np
from numpy.typing import NDArray
from tautscope import Twin, load_config
from tautscope.calibration.colour import ColorDiscriminant

Pixels = NDArray[np.uint8]


def labelled(frame_file: str, mask_file: str) -> tuple[Pixels, Pixels]:
    """The pixels of bands and of everything else, (n, 3) B, G, R."""
    frame, mask = cv2.imread(frame_file), cv2.imread(mask_file, cv2.IMREAD_GRAYSCALE)
    if frame is None or mask is None or frame.shape[:2] != mask.shape:
        raise SystemExit(f"{frame_file}, {mask_file}: two pictures of one size are needed")
    return frame[mask > 250], frame[mask < 5]


def from_the_twin() -> tuple[Pixels, Pixels]:
    """Around the true centres of the bands, and far from them."""
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
    found = [labelled(*pair) for pair in pairs] or [from_the_twin()]
    bands, rest = (np.concatenate(pixels) for pixels in zip(*found, strict=True))
    colour = ColorDiscriminant.fit(bands, rest)
    print("[vision]")
    print(f"weights = [{', '.join(f'{weight:.3f}' for weight in colour.weights)}]")
    print(f"threshold = {colour.threshold:.1f}")
    hit, wrong = (100 * colour.is_marker(pixels).mean() for pixels in (bands, rest))
    print(f"# taken for marker: {hit:.1f} % of the bands, {wrong:.2f} % of everything else")


if __name__ == "__main__":
    main()
