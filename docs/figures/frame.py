"""Draws frame.jpg: one camera image of a run on the twin, and what the loop saw in it.

The article's experiment, seed 0, stopped in the insertion's second period. Run it with
``uv run python docs/figures/frame.py``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray
from tautscope import Frame, HysteresisReduction, Report, Twin, load_config
from tautscope.figure_style import YELLOW, style
from tautscope.references import SineSequence

Floats = NDArray[np.float64]

STOP = 14.4
"""Time of the frame [s]."""
CUT = 78.0
"""Half the width of the magnified part [px]."""
MEASURED, PREDICTED = YELLOW, "#ffffff"


def main() -> None:
    """Write frame.jpg beside this file."""
    frame, report = newest_frame(STOP)
    picture = np.ascontiguousarray(frame.image[:, :, ::-1])
    measured = np.reshape(report.detection.features if report.detection else [], (2, 2))
    predicted = report.predicted_features.reshape(2, 2)
    middle = measured.mean(axis=0)
    height, width = picture.shape[:2]
    half = np.array([CUT, CUT * height / width])

    with style():
        figure = Figure(figsize=(7.2, 3.1), layout="constrained")
        whole, part = figure.subplots(1, 2)
        whole.imshow(picture)
        whole.add_patch(
            Rectangle(tuple(middle - half), *(2 * half), fill=False, color=PREDICTED, linewidth=0.8)
        )
        whole.set_title("(a) the camera's image")
        part.imshow(picture, interpolation="nearest")
        draw_features(part, measured, predicted)
        part.set_xlim(middle[0] - half[0], middle[0] + half[0])
        part.set_ylim(middle[1] + half[1], middle[1] - half[1])
        part.set_title("(b) bands A and B")
        for axes in (whole, part):
            axes.set_axis_off()
        target = Path(__file__).with_suffix(".jpg")
        figure.savefig(target, dpi=320, pil_kwargs={"quality": 80})


def newest_frame(stop: float) -> tuple[Frame, Report]:
    """Run the loop on the twin until `stop` [s]; the newest frame and what became of it."""
    config = load_config()
    reference = SineSequence(config.experiment)
    loop, twin = HysteresisReduction(config), Twin(config)
    sample = twin.reset()
    newest = None
    while sample.time < stop or newest is None:
        sample = twin.step(loop.step(reference(sample.time), sample.time))
        if sample.frame is not None:
            newest = sample.frame, loop.on_frame(sample.frame)
    twin.close()
    return newest


def draw_features(axes: Axes, measured: Floats, predicted: Floats) -> None:
    """Measured and predicted centroids [px]."""
    axes.plot(*predicted.T, "x", color=PREDICTED, markersize=8, label="predicted from the command")
    axes.plot(
        *measured.T,
        "o",
        color=MEASURED,
        fillstyle="none",
        markeredgewidth=1.5,
        markersize=9,
        label="measured in the image",
    )
    for name, (u, v) in zip("AB", measured, strict=True):
        axes.annotate(
            name,
            (u, v),
            xytext=(0, 9),
            textcoords="offset points",
            ha="center",
            color=MEASURED,
            fontweight="bold",
        )
    axes.legend(loc="lower right", frameon=True, facecolor="#333333", labelcolor="white")


if __name__ == "__main__":
    main()
