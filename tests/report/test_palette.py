"""Colours of the figures: one palette, distinct for every colour vision."""

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from common.paths import ROOT
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image
from tautscope import figure_style as style

PALETTE = [
    style.BLACK, style.BLUE, style.ORANGE, style.GREEN, style.PURPLE, style.SKY, style.AMBER,
    style.YELLOW,
]  # fmt: skip
VISIONS = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216],
                   [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413],
                     [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602],
                   [0.004733, 0.691367, 0.303900]],
}  # fmt: skip
"""Linear sRGB as seen with severity 1: Machado, Oliveira, Fernandes (2009), Table 1."""
DIFFERENCE = 10.0
"""CIE76 colour difference that everyone sees at once: several just noticeable ones (2.3)."""


def lab(colour: str, vision: str) -> NDArray[np.float64]:
    """CIELAB of an sRGB colour (D65, IEC 61966-2-1) as a colour vision has it."""
    rgb = np.array(to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    linear = np.clip(np.asarray(VISIONS[vision]) @ linear, 0, 1)
    xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]] @ linear
    t = xyz / [0.9505, 1.0, 1.089]
    f = np.where(t > (6 / 29) ** 3, np.cbrt(t), t / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def test_the_conversion_is_that_of_the_standard() -> None:
    np.testing.assert_allclose(lab("#ffffff", "normal"), [100, 0, 0], atol=0.02)
    np.testing.assert_allclose(lab("#ff0000", "normal"), [53.24, 80.09, 67.20], atol=0.05)


@pytest.mark.parametrize("vision", VISIONS)
def test_all_colours_differ_for_every_colour_vision(vision: str) -> None:
    colours = [lab(colour, vision) for colour in PALETTE]
    distances = [np.linalg.norm(a - b) for a, b in itertools.combinations(colours, 2)]
    assert min(distances) > DIFFERENCE


def test_red_and_green_would_not_pass() -> None:
    a, b = (lab(colour, "deuteranopia") for colour in ("#8a5a00", "#4d7000"))
    assert np.linalg.norm(a - b) < DIFFERENCE


@pytest.mark.parametrize(
    "file",
    [
        file.relative_to(ROOT).as_posix()
        for folder in ("python", "benchmarks", "docs", "examples")
        for file in sorted((ROOT / folder).rglob("*.py"))
        if "matplotlib" in file.read_text(encoding="utf-8") and file.name != "figure_style.py"
    ],
)
def test_every_figure_has_its_colours_from_the_palette(file: str) -> None:
    for colour in re.findall(r'"#([0-9a-fA-F]{6})"', (ROOT / file).read_text(encoding="utf-8")):
        assert colour[:2] == colour[2:4] == colour[4:], f"#{colour} is neither grey nor a name"


def test_a_saved_drawing_has_the_size_asked_for_and_a_palette(tmp_path: Path) -> None:
    with style.style():
        figure = Figure(figsize=(2, 1))
        figure.subplots().plot([0, 1])
        style.save_png(figure, tmp_path / "a.png", dpi=300)
    with Image.open(tmp_path / "a.png") as image:
        assert image.size == (600, 300)
        assert image.mode == "P"
        assert to_rgb(style.BLUE) in [
            tuple(channel / 255 for channel in colour)
            for _, colour in image.convert("RGB").getcolors()
        ]
