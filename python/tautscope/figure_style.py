"""Palette and style of every figure; nothing here uses pyplot's global state or a display."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from typing import Any

import matplotlib
from cycler import cycler
from matplotlib.figure import Figure

BLACK, GREY = "#222222", "#8a8a8a"
BLUE, ORANGE, GREEN, PURPLE = "#0072b2", "#d55e00", "#009e73", "#cc79a7"
SKY, AMBER, YELLOW = "#56b4e9", "#e69f00", "#f0e442"
"""Colours that readers with any colour vision can distinguish: Okabe and Ito, Color Universal
Design (2008). Its vermillion is `ORANGE` and its orange `AMBER`; `YELLOW` is for images."""

PAGE = 7.2
"""Width of a page [inch]."""

_STYLE: dict[str, Any] = {
    "font.size": 8,
    "font.family": "DejaVu Sans",
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "axes.prop_cycle": cycler(
        color=[BLUE, ORANGE, GREEN, PURPLE, SKY, AMBER, BLACK, GREY, "#bbbbbb"]
    ),
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "lines.linewidth": 1.0,
    "figure.constrained_layout.w_pad": 0.08,
    "savefig.dpi": 200,
    "pdf.fonttype": 42,
}


@contextmanager
def style() -> Iterator[None]:
    """Context in which figures are made and saved in the package's style."""
    with matplotlib.rc_context(_STYLE):  # type: ignore[arg-type]  # its stub lists every key
        yield


def save_png(figure: Figure, path: str | PathLike[str], dpi: float) -> None:
    """Save a drawing as a PNG of 128 colours, a third of the size; not for photographs.

    Raises:
        OSError: The file cannot be written.
    """
    from PIL import Image  # noqa: PLC0415  a dependency of matplotlib

    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=dpi)
    with Image.open(data) as image:
        drawn = image.convert("RGB").quantize(128, dither=Image.Dither.NONE)
        drawn.save(path, format="png", optimize=True)
