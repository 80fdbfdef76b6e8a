"""Draws problem.png: the slack of an instrument, and what the compensator leaves of it.

Every line comes out of the package's own `Play` and `Compensator`; the offsets are taken as known.
Run it with ``uv run python docs/figures/problem.py``.
"""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from tautscope import Compensator, Play
from tautscope.figure_style import AMBER, BLACK, BLUE, GREY, ORANGE, save_png, style

Floats = NDArray[np.float64]

PERIOD, STROKE = 10.0, 15.0
"""Period and stroke of the reference [s, mm]."""
OFFSETS = {"delta_minus": -5.0, "delta_plus": 5.0}
"""Of the slack [mm]: 10 mm wide, the insertion of the article's Table 1."""


def main() -> None:
    """Write problem.png beside this file."""
    time = np.linspace(0, 2.25 * PERIOD, 4501)
    reference = STROKE * np.sin(2 * np.pi * time / PERIOD)
    command = Compensator(free_gain=5.0, gain_limit=5.0, **OFFSETS).run(reference)
    plain, compensated = (Play(**OFFSETS).run(motor) for motor in (reference, command))

    with style():
        figure = Figure(figsize=(7.2, 3.7), layout="constrained")
        grid = figure.add_gridspec(2, 2, width_ratios=(1.75, 1))
        above = figure.add_subplot(grid[0, 0])
        below = figure.add_subplot(grid[1, 0], sharex=above, sharey=above)
        loop = figure.add_subplot(grid[:, 1])
        draw_signals(above, time, reference, reference, plain)
        above.set_title("(a) without: the tip stands still after each reversal")
        above.tick_params(labelbottom=False)
        draw_signals(below, time, reference, command, compensated)
        below.set_title("(b) with: the motor crosses the slack five times as fast")
        below.set_xlabel("time [s]")
        draw_loops(loop, reference, plain, compensated)
        lines, labels = below.get_legend_handles_labels()
        figure.legend(lines, labels, loc="outside lower left", ncols=4)
        save_png(figure, Path(__file__).with_suffix(".png"), dpi=320)


def draw_signals(axes: Axes, time: Floats, reference: Floats, motor: Floats, tip: Floats) -> None:
    """Reference, motor and tip over time [mm]; shaded where only the motor moves."""
    shown = time >= PERIOD / 4
    time, reference, motor, tip = (
        values[shown] for values in (time - PERIOD / 4, reference, motor, tip)
    )
    stuck = np.isclose(np.gradient(tip), 0.0, atol=1e-9)
    axes.fill_between(
        time,
        0,
        1,
        where=stuck.tolist(),
        transform=axes.get_xaxis_transform(),
        color=AMBER,
        alpha=0.2,
        linewidth=0,
        label="motor moves, tip does not",
    )
    axes.plot(time, motor, color=ORANGE, linewidth=1.4, label="motor")
    axes.plot(time, reference, color=BLACK, linestyle=(0, (4, 2)), linewidth=0.9, label="reference")
    axes.plot(time, tip, color=BLUE, linewidth=1.6, label="tip")
    axes.set_ylabel("insertion [mm]")
    axes.set_xlim(time[0], time[-1])
    axes.set_ylim(-24, 24)


def draw_loops(axes: Axes, reference: Floats, plain: Floats, compensated: Floats) -> None:
    """Tip over reference [mm], the last period of each."""
    last = slice(-2001, None)
    axes.plot(reference[last], plain[last], color=GREY, linewidth=1.6, label="without: 10 mm wide")
    axes.plot(
        reference[last], compensated[last], color=BLUE, linewidth=1.6, label="with: 2 mm wide"
    )
    axes.set_title("(c) tip over reference")
    axes.set_xlabel("reference [mm]")
    axes.set_ylabel("tip [mm]")
    axes.set_box_aspect(1)
    axes.set_xlim(-18, 18)
    axes.set_ylim(-18, 18)
    axes.legend(loc="upper left")


if __name__ == "__main__":
    main()
