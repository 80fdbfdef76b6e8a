"""A page in which a person clicks on the bands of an image."""

import base64
import shlex
from html import escape
from pathlib import Path

import cv2

from tautscope.calibration.images import read_image
from tautscope.runs.output_folder import check_free_file

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


def write_click_page(image_file: Path, page: Path) -> None:
    """Write a self-contained page that makes the command with the clicks.

    Raises:
        MissingPathError, FieldError: The image cannot be read.
        OutputError: The page exists or cannot be written.
    """
    image = read_image(image_file)
    check_free_file(page)
    _, data = cv2.imencode(".png", image)
    command = shlex.join(["tautscope", "calibrate", "colour", str(image_file)])
    text = _PAGE.replace("COMMAND", escape(command, quote=True))
    text = text.replace("PIXELS", base64.b64encode(data.tobytes()).decode())
    page.write_text(text, encoding="utf-8")
