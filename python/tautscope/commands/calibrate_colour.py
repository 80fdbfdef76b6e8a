"""The command ``tautscope calibrate colour``."""

from __future__ import annotations

import argparse
import base64
import shlex
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.calibration.result import CalibrationResult
from tautscope.commands import arguments, calibration_output, calibration_rig, positions
from tautscope.commands.printing import print_json, progress_bar
from tautscope.errors import FieldError
from tautscope.runs.output_folder import new_file

if TYPE_CHECKING:
    from tautscope.calibration.bands.labels import LabelledImage

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>tautscope: click on the bands</title>
<style>
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem; }
canvas { max-width: 100%; cursor: crosshair; }
pre { background: #f6f6f6; padding: .8rem 1rem; white-space: pre-wrap; user-select: all; }
</style></head><body>
<p>Click into the middle of each of the two bands; a third click begins anew.
Then copy the command.</p>
<canvas></canvas>
<pre data-command="COMMAND"></pre>
<script>
const canvas = document.querySelector("canvas"), line = document.querySelector("pre");
const image = new Image(), context = canvas.getContext("2d");
let clicks = [];
function draw() {
  context.drawImage(image, 0, 0);
  context.strokeStyle = "yellow";
  for (const [u, v] of clicks) {
    context.strokeRect(u - 5, v - 5, 11, 11);
  }
  line.textContent = line.dataset.command + clicks.map(([u, v]) => ` --click ${u},${v}`).join("");
}
image.onload = () => { canvas.width = image.width; canvas.height = image.height; draw(); };
canvas.onclick = (event) => {
  const box = canvas.getBoundingClientRect(), scale = canvas.width / box.width;
  if (clicks.length == 2) clicks = [];
  const place = [event.clientX - box.left, event.clientY - box.top];
  clicks.push(place.map((x) => Math.floor(x * scale)));
  draw();
};
image.src = "data:image/png;base64,PIXELS";
</script></body></html>
"""
"""A page in which a person clicks on the bands of an image."""


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
    positions.add_motor_options(colour)
    calibration_rig.add_options(colour)
    calibration_output.add_options(colour)


def _pixel(text: str) -> tuple[int, int]:
    u, _, v = text.partition(",")
    if not (u.strip().isdecimal() and v.strip().isdecimal()):
        raise argparse.ArgumentTypeError(f"got {text!r}, expected U,V: two whole numbers")
    return int(u), int(v)


def _run(options: argparse.Namespace) -> None:
    from tautscope.calibration.bands.result import colour_result  # noqa: PLC0415

    files: list[Path] = options.files
    if options.page is not None:
        of_clicks = ("click", "motors", "units", "video_start", "twin", "seed", "yes")
        only_page = "no --page, which calibrates nothing"
        arguments.refuse_unused(options, only_page, *of_clicks, "config", "write", "out")
        _write_page(options, files)
        return
    record = files[0] if len(files) == 1 and not options.click else None
    calibration_rig.check_options(options, is_motion=not files)
    positions.check_motor_options(options, record)
    reads_config = record is not None or not files
    calibration_output.check_options(options, reads_config=reads_config)
    is_labelled = bool(files or options.click)
    found = colour_result(_labelled(options, record)) if is_labelled else calibrate(options)
    calibration_output.finish(options, found)


def _write_page(options: argparse.Namespace, files: Sequence[Path]) -> None:
    """Write a self-contained page that makes the command with the clicks."""
    import cv2  # noqa: PLC0415

    from tautscope.calibration.images import read_image  # noqa: PLC0415

    if len(files) != 1:
        raise FieldError("files", len(files), "one image, with --page")
    image = read_image(files[0])
    _, data = cv2.imencode(".png", image)
    command = shlex.join(["tautscope", "calibrate", "colour", str(files[0])])
    text = _PAGE.replace("COMMAND", escape(command, quote=True))
    text = text.replace("PIXELS", base64.b64encode(data.tobytes()).decode())
    with new_file(options.page) as partial:
        partial.write_text(text, encoding="utf-8")
    print_json(options, {"file": str(options.page)})
    print(f"Open {options.page} in a browser, and click on the bands.")


def calibrate(options: argparse.Namespace) -> CalibrationResult:
    """Move the rig or the twin, and fit the colour of what moves with the motors."""
    from tautscope.calibration.bands.motion import record_motion  # noqa: PLC0415
    from tautscope.calibration.bands.result import colour_result  # noqa: PLC0415

    with calibration_rig.open_rig(options) as setup, progress_bar("motion") as progress:
        found = record_motion(setup.rig, setup.config, progress)
    return colour_result(found.label(), setup.serial_numbers)


def _labelled(options: argparse.Namespace, record: Path | None) -> list[LabelledImage]:
    """The images of the clicks, of a record of a motion, or of the masks."""
    from tautscope.calibration.bands.labels import from_mask, label_clicks  # noqa: PLC0415
    from tautscope.calibration.bands.motion import ImageSequence  # noqa: PLC0415
    from tautscope.calibration.images import read_image  # noqa: PLC0415

    files: list[Path] = options.files
    if options.click:
        if len(files) != 1:
            raise FieldError("files", len(files), "one image, with --click")
        return [label_clicks(read_image(files[0]), options.click)]
    if record is not None:
        allowed = "a log (.mcap), a video with --motors, an image with --click, IMAGE MASK ..."
        return positions.read_motion(options, record, ImageSequence, allowed)[0].label()
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
