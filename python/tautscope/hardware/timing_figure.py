"""The figure of how punctual a run on hardware was."""

import numpy as np
from matplotlib.figure import Figure

from tautscope.figure_style import BLUE, ORANGE, PAGE, style
from tautscope.hardware.timing import Timing


def timing_figure(timing: Timing) -> Figure:
    """How punctual a run on hardware was.

    (a) how much later than due each set-point was sent, over the run; (b) its distribution;
    (c) from capture until the loop was given the frame; (d) its distribution.
    """
    cycles, frames = timing.cycles, timing.frames
    begin = cycles[0, 0] if len(cycles) else 0.0
    held = cycles[:, 3] == 0
    with style():
        figure = Figure(figsize=(PAGE, 4.2), layout="constrained")
        axes = figure.subplots(2, 2, width_ratios=(2.2, 1))
        for row, at, values, what in (
            (axes[0], cycles[:, 0] - begin, 1e3 * timing.jitter, "set-point late by"),
            (axes[1], frames[:, 2] - begin, 1e3 * timing.frame_age, "age of frame"),
        ):
            row[0].plot(at, values, ".", color=BLUE, markersize=1.5, rasterized=True)
            row[0].set_xlabel("time [s]")
            row[0].set_ylabel(f"{what} [ms]")
            row[0].set_ylim(bottom=0)
            row[1].hist(values, bins=100, color=BLUE, log=True)
            row[1].set_xlabel(f"{what} [ms]")
            row[1].set_ylabel("number")
        if held.any():
            axes[0, 0].plot(
                cycles[held, 0] - begin,
                np.zeros(held.sum()),
                "|",
                color=ORANGE,
                markersize=12,
                clip_on=False,
                zorder=3,
                label="held",
            )
            axes[0, 0].legend(loc="upper right")
        axes[0, 0].set_title(f"(a) set-points: {len(cycles)} cycles, {timing.lost} lost")
        axes[1, 0].set_title(f"(c) frames: {len(frames)}")
        axes[0, 1].set_title("(b)")
        axes[1, 1].set_title("(d)")
    return figure
