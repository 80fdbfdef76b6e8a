"""The slack in each episode of a data set, as a figure."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tautscope.figure_style import BLUE, GREY, PAGE, style


def episodes_figure(rows: Sequence[dict[str, Any]], names: Sequence[str]) -> Figure:
    """Width with its interval in each episode, one panel per degree of freedom."""
    with style():
        figure = Figure(figsize=(PAGE, 0.6 + 1.6 * len(names)), layout="constrained")
        panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(panels, names, strict=True):
            own = [row for row in rows if row["name"] == name]
            known = [row for row in own if row["identified"]]
            at, width, low, high = (
                np.array([row[key] for row in known], np.float64)
                for key in ("episode", "width", "width_low", "width_high")
            )
            axes.vlines(at, low, high, color=BLUE, linewidth=0.8, alpha=0.5)
            axes.plot(at, width, "o", color=BLUE, markersize=2.5)
            if known:
                axes.axhline(float(np.median(width)), color=GREY, linewidth=0.8, zorder=0)
            axes.margins(y=0.15)
            axes.set_ylim(bottom=0)
            axes.set_ylabel("slack")
            median = f", median {np.median(width):.3g}" if known else ""
            axes.set_title(f"{name}: identified in {len(known)} of {len(own)} episodes{median}")
        panels[-1].set_xlabel("episode")
    return figure
