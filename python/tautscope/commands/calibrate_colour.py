"""The command ``tautscope calibrate colour``."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tautscope.commands import arguments
from tautscope.commands.printing import print_json
from tautscope.errors import FieldError, MissingPathError

Pixels = NDArray[np.uint8]


def add_parser(kinds: arguments.Verbs) -> None:
    """Add the command to the parser of ``tautscope calibrate``."""
    colour = arguments.add_verb(
        kinds,
        "colour",
        help="colour of the bands, from images and masks",
        description="Fit the colour of the bands to images and masks, and print the section "
        "[vision] of a configuration. A mask is white on the bands, black elsewhere, and grey "
        "where pixels are to be ignored: edges of the bands, overexposed pixels.",
        extras=["hardware"],
    )
    colour.add_argument(
        "files",
        nargs="+",
        type=Path,
        metavar="IMAGE MASK",
        help="pairs of an image and its mask, of the same size",
    )
    arguments.add_json(colour)
    colour.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> None:
    from tautscope.calibration.colour import ColorDiscriminant  # noqa: PLC0415

    files: list[Path] = options.files
    if len(files) % 2:
        raise FieldError("files", len(files), "pairs of an image and its mask")
    pairs = zip(files[::2], files[1::2], strict=True)
    labelled = [_labelled_pixels(*pair) for pair in pairs]
    bands, background = (np.concatenate(pixels) for pixels in zip(*labelled, strict=True))
    colour = ColorDiscriminant.fit(bands, background)
    weights, threshold = [float(weight) for weight in colour.weights], float(colour.threshold)
    hits, errors = (float(colour.is_marker(pixels).mean()) for pixels in (bands, background))
    if options.json:
        print_json(
            {
                "vision": {"weights": weights, "threshold": threshold},
                "bands_classified_as_marker": hits,
                "background_classified_as_marker": errors,
            }
        )
        return
    print("[vision]")
    print(f"weights = [{', '.join(f'{weight:.3f}' for weight in weights)}]")
    print(f"threshold = {threshold:.1f}")
    print(f"# classified as marker: {hits:.1%} of the bands, {errors:.2%} of the background")


def _labelled_pixels(frame_file: Path, mask_file: Path) -> tuple[Pixels, Pixels]:
    """Pixels of the bands and of the background, (n, 3) B, G, R."""
    import cv2  # noqa: PLC0415

    frame = _read_image(frame_file, cv2.IMREAD_COLOR)
    mask = _read_image(mask_file, cv2.IMREAD_GRAYSCALE)
    if frame.shape[:2] != mask.shape:
        sizes = f"{frame.shape[1]} x {frame.shape[0]} and {mask.shape[1]} x {mask.shape[0]}"
        raise FieldError(f"{frame_file}, {mask_file}", sizes, "two images of the same size")
    return frame[mask > 250], frame[mask < 5]


def _read_image(file: Path, kind: int) -> Pixels:
    import cv2  # noqa: PLC0415

    if not file.is_file():
        raise MissingPathError("image", str(file), "an image file")
    image = cv2.imread(str(file), kind)
    if image is None:
        raise FieldError("image", str(file), "an image that OpenCV reads: PNG, JPEG, TIFF, ...")
    return np.asarray(image, dtype=np.uint8)
