"""Figure of a camera calibration: coverage and residuals."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from tautscope.calibration.camera.coverage import COLUMNS, ROWS, Coverage
from tautscope.calibration.camera.intrinsics import CameraFit
from tautscope.figure_style import BLUE

CAPTION = (
    "Left: all corners of the board that were used, in the image, with the cells that had to be "
    "covered. Right: measured minus projected corners, with their root mean square."
)


def coverage_figure(fit: CameraFit, coverage: Coverage) -> Figure:
    """The corners in the image, and the residuals."""
    width, height = fit.intrinsics.size
    figure = Figure(figsize=(9, 4.4), layout="constrained")
    image, scatter = figure.subplots(1, 2, width_ratios=(width / height, 1))
    corners = np.concatenate([view.pixels for view in fit.views])
    image.scatter(*corners.T, s=3, linewidths=0, color=BLUE)
    for row in range(ROWS):
        for column in range(COLUMNS):
            place = (column + 0.5) * width / COLUMNS, (row + 0.5) * height / ROWS
            count = int(coverage.corners[row, column])
            box = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}
            image.text(*place, str(count), ha="center", va="center", fontsize=8, bbox=box)
    for k in range(1, COLUMNS):
        image.axvline(k * width / COLUMNS, color="0.7", linewidth=0.6)
    for k in range(1, ROWS):
        image.axhline(k * height / ROWS, color="0.7", linewidth=0.6)
    image.set(xlim=(0, width), ylim=(height, 0), xlabel="u [px]", ylabel="v [px]", aspect="equal")
    image.set_title(f"{len(corners)} corners in {len(fit.views)} views", fontsize=10)
    scatter.scatter(*fit.residuals.T, s=3, linewidths=0, color=BLUE)
    scatter.axhline(0, color="0.7", linewidth=0.6)
    scatter.axvline(0, color="0.7", linewidth=0.6)
    reach = 1.05 * float(np.abs(fit.residuals).max())
    scatter.set(xlim=(-reach, reach), ylim=(reach, -reach), aspect="equal")
    scatter.set(xlabel="residual in u [px]", ylabel="residual in v [px]")
    scatter.set_title(f"reprojection error {fit.residual:.3f} px", fontsize=10)
    return figure
