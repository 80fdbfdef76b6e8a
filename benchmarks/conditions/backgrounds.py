"""Backgrounds of the condition benchmark: procedural mucosa, colon frames, crops of them."""

import argparse
import tempfile
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from common.paths import DATA
from numpy.typing import NDArray

FRAMES = DATA / "colon_frames"
KINDS = ("procedural", "frames", "crops")
"""Kinds of background."""
TUNING_FRAMES = 5
"""The first frames by name; they and their crops are for tuning, the others for the figures."""
CROPS = 20
"""Number of random crops."""


def require_frames(parser: argparse.ArgumentParser) -> None:
    """End the program if there are no frames besides those for tuning."""
    if len(list(FRAMES.glob("*.jpg"))) <= TUNING_FRAMES:
        text = f"more than {TUNING_FRAMES} files {FRAMES}/*.jpg are needed"
        parser.error(f"{text}. Set TAUTSCOPE_DATA to the folder of real data.")


@cache
def write_backgrounds(kind: str, is_tuning: bool) -> tempfile.TemporaryDirectory[str] | None:
    """Write the images of one kind to a folder of this process; None for procedural mucosa.

    A crop is 35 to 80 % of a frame's width and height, turned by a multiple of 90 deg and perhaps
    mirrored.
    """
    if kind == "procedural":
        return None
    files = sorted(FRAMES.glob("*.jpg"))
    files = files[:TUNING_FRAMES] if is_tuning else files[TUNING_FRAMES:]
    images = [image for file in files if (image := cv2.imread(str(file))) is not None]
    if kind == "crops":
        rng = np.random.default_rng([CROPS, is_tuning])
        images = [_crop(images[rng.integers(len(images))], rng) for _ in range(CROPS)]
    folder = tempfile.TemporaryDirectory(prefix="tautscope-")
    for index, image in enumerate(images):
        cv2.imwrite(str(Path(folder.name) / f"{index:02d}.png"), image)
    return folder


def _crop(image: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    height, width = (round(rng.uniform(0.35, 0.8) * side) for side in image.shape[:2])
    top = int(rng.integers(0, image.shape[0] - height + 1))
    left = int(rng.integers(0, image.shape[1] - width + 1))
    part = np.rot90(image[top : top + height, left : left + width], int(rng.integers(4)))
    return np.ascontiguousarray(part[:, ::-1] if rng.random() < 0.5 else part)
