"""The command ``tautscope calibrate colour``."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.calibration.result import CalibrationResult
from tautscope.commands import arguments
from tautscope.commands.calibration_output import add_options, check_options, finish
from tautscope.commands.calibration_rig import (
    add_rig_options,
    check_rig_options,
    rig_for_calibration,
)
from tautscope.commands.printing import print_json, progress_bar
from tautscope.commands.recorded_motion import (
    add_motor_options,
    check_motor_options,
    read_motion,
)
from tautscope.errors import FieldError

if TYPE_CHECKING:
    from tautscope.calibration.bands.labels import LabelledImage


def add_parser(kinds: arguments.Verbs) -> None:
    """Add the command to the parser of ``tautscope calibrate``."""
    colour = arguments.add_verb(
        kinds,
        "colour",
        _run,
        help="colour of the bands, from their motion, clicks or masks",
        description="Fit the colour of the bands, and print the section [vision]. Without files, "
        "the rig of --config or the twin moves insertion and bending for 10 s, and the bands are "
        "the two regions of one colour that move with the motors; THE MOTORS MOVE. A log, or a "
        "video with motor positions, does the same. Or give one image with a click on each band, "
        "or pairs of an image and its mask: white on the bands, black elsewhere, grey where pixels "
        "are to be ignored.",
        extras=["hardware"],
    )
    colour.add_argument(
        "files",
        nargs="*",
        type=Path,
        metavar="FILE",
        help="pairs IMAGE MASK; one IMAGE with --click; a log; a video with --motors",
    )
    colour.add_argument(
        "--click",
        action="append",
        type=_pixel,
        default=[],
        metavar="U,V",
        help="a pixel on a band, from the left and from the top; give it twice",
    )
    colour.add_argument(
        "--page",
        type=Path,
        metavar="FILE.html",
        help="only write a page of the image that makes the command from clicks",
    )
    add_motor_options(colour)
    add_rig_options(colour)
    add_options(colour)


def _pixel(text: str) -> tuple[int, int]:
    u, _, v = text.partition(",")
    if not (u.strip().isdecimal() and v.strip().isdecimal()):
        raise argparse.ArgumentTypeError(f"got {text!r}, expected U,V: two whole numbers")
    return int(u), int(v)


def _run(options: argparse.Namespace) -> None:
    files: list[Path] = options.files
    if options.page is not None:
        of_clicks = ("click", "motors", "video_start", "twin", "seed", "yes")
        only_page = "no --page, which calibrates nothing"
        arguments.refuse_unused(options, only_page, *of_clicks, "config", "write", "out")
        _write_page(options, files)
        return
    record = files[0] if len(files) == 1 and not options.click else None
    check_rig_options(options, is_motion=not files)
    check_motor_options(options, record)
    check_options(options, reads_config=record is not None or not files)
    if options.click:
        images = _clicked(files, options.click)
    elif not files:
        finish(options, calibrate(options))
        return
    elif record is not None:
        from tautscope.calibration.bands.motion import ImageSequence  # noqa: PLC0415

        allowed = "a log (.mcap), a video with --motors, an image with --click, IMAGE MASK ..."
        images = read_motion(options, record, ImageSequence, allowed)[0].label()
    else:
        images = _masked(files)
    finish(options, _result(images))


def _write_page(options: argparse.Namespace, files: Sequence[Path]) -> None:
    from tautscope.commands.click_page import write_click_page  # noqa: PLC0415

    if len(files) != 1:
        raise FieldError("files", len(files), "one image, with --page")
    write_click_page(files[0], options.page)
    print_json(options, {"file": str(options.page)})
    print(f"Open {options.page} in a browser, and click on the bands.")


def calibrate(options: argparse.Namespace) -> CalibrationResult:
    """Move the rig or the twin, and fit the colour of what moves with the motors."""
    from tautscope.calibration.bands.motion import record_motion  # noqa: PLC0415

    with rig_for_calibration(options) as setup, progress_bar("motion") as progress:
        found = record_motion(setup.rig, setup.config, progress)
    return _result(found.label(), setup.serial_numbers)


def _result(
    images: Sequence[LabelledImage], serial_numbers: Mapping[str, str] | None = None
) -> CalibrationResult:
    from tautscope.calibration.bands.result import colour_result, fit_colour  # noqa: PLC0415

    return colour_result(fit_colour(images), images, serial_numbers or {})


def _clicked(files: Sequence[Path], clicks: Sequence[tuple[int, int]]) -> list[LabelledImage]:
    from tautscope.calibration.bands.labels import label_clicks  # noqa: PLC0415
    from tautscope.calibration.images import read_image  # noqa: PLC0415

    if len(files) != 1:
        raise FieldError("files", len(files), "one image, with --click")
    return [label_clicks(read_image(files[0]), clicks)]


def _masked(files: Sequence[Path]) -> list[LabelledImage]:
    from tautscope.calibration.bands.labels import from_mask  # noqa: PLC0415
    from tautscope.calibration.images import read_image  # noqa: PLC0415

    if len(files) % 2:
        raise FieldError("files", len(files), "pairs of an image and its mask")
    images = []
    for frame_file, mask_file in zip(files[::2], files[1::2], strict=True):
        frame, mask = read_image(frame_file), read_image(mask_file, is_grey=True)
        if frame.shape[:2] != mask.shape:
            sizes = f"{frame.shape[1]} x {frame.shape[0]} and {mask.shape[1]} x {mask.shape[0]}"
            raise FieldError(f"{frame_file}, {mask_file}", sizes, "two images of the same size")
        images.append(from_mask(frame, mask))
    return images
