"""Image disturbances of the video processor: text overlay and the inset of the scope guide.

Images are uint8 (height, width, 3), BGR. Layout and colours are those of real colonoscopy images.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from tautscope.twin.bands import Bands, Mask
from tautscope.twin.noise import TemporalNoise

Image = NDArray[np.uint8]
Overlaid = tuple[Image, Mask | None]
_WHITE, _GREEN, _TEAL, _INK = (236, 238, 238), (70, 220, 90), (136, 165, 20), (38, 44, 40)


def inset(image: Image, _: Bands, noise: TemporalNoise) -> Overlaid:
    """Green window of the scope guide, lower left, in which the scope's outline moves slowly."""
    height, width = image.shape[:2]
    left, top, right, bottom = 0, round(0.68 * height), round(0.33 * width), round(0.98 * height)
    cv2.rectangle(image, (left, top), (right - 1, bottom - 1), _TEAL, -1)
    size = np.array([right - left, bottom - top])
    t = np.linspace(0, 1, 40)
    bend, lean = 0.7 + 0.4 * noise.scalar("bend", 120), 0.12 * noise.scalar("lean", 90)

    x = 0.62 + lean * t + 0.13 * bend * np.sin(2 * np.pi * t)
    y = 1.0 - 0.35 * t - 0.30 * bend * np.sin(np.pi * t)
    points = np.rint(16 * (np.array([left, top]) + np.stack([x, y], 1) * size)).astype(np.int32)
    thick = max(1, round(width / 280))
    cv2.polylines(image, [points], False, _INK, thick, cv2.LINE_AA, 4)
    scale = width / 720
    _write(image, "Fh:A1 Cm:1", (12, round(top / scale) + 12), _WHITE)
    hidden = np.zeros((height, width), dtype=bool)
    hidden[top:bottom, left:right] = True
    return image, hidden


def text(image: Image, _: Bands, noise: TemporalNoise) -> Overlaid:
    """White and green text at the left and upper right, a clock, white squares."""
    before = image.copy()
    height, width = image.shape[:2]
    scale, foot = width / 720, round(height * 720 / width)
    seconds = noise.sequence // 25
    clock = f"{seconds // 3600:02d}:{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    bottom = foot - 60
    lines = [
        ("ID:", 20, 30, _WHITE),
        ("Name:", 20, 50, _WHITE),
        ("Sex:   Age:", 20, 100, _WHITE),
        ("D.O.B.:", 20, 120, _WHITE),
        ("26/09/2014", 20, 140, _WHITE),
        (clock, 20, 160, _WHITE),
        ("CVP:6   Gr:N", 20, 200, _GREEN),
        ("SCV 12", 600, 30, _GREEN),
        ("Eh:A5 Cm:1", 600, 50, _GREEN),
        ("Physician:", 20, bottom, _WHITE),
        ("Comment:", 20, bottom + 22, _GREEN),
    ]
    for line, x, y, colour in lines:
        _write(image, line, (x, y), colour)
    for k in range(6):
        corner = np.rint(scale * np.array([20 + 17 * k, 218])).astype(int)
        cv2.rectangle(image, corner.tolist(), (corner + round(11 * scale)).tolist(), _WHITE, -1)
    # A label that the user places for a while.
    number, level = noise.episode("label", 100)
    if level > 0.3:
        x, y = noise.generator("label", number).uniform([160, 60], [520, 500])
        _write(image, "biopsy 1", (round(x), round(y)), _GREEN if number % 2 else _WHITE, 0.7)
    return image, np.asarray((image != before).any(axis=2))


def _write(
    image: Image,
    line: str,
    position: tuple[int, int],
    colour: tuple[int, int, int],
    size: float = 0.45,
) -> None:
    """Write outlined text; position and size as for an image 720 px wide."""
    scale = image.shape[1] / 720
    at = (round(scale * position[0]), round(scale * position[1]))
    thin, font = max(1, round(scale)), cv2.FONT_HERSHEY_SIMPLEX
    for shade, thick in (((16, 16, 16), thin + 2), (colour, thin)):
        cv2.putText(image, line, at, font, size * scale, shade, thick, cv2.LINE_AA)
