"""The figure of a verdict, for a slide: the loop with its width, and the tip over time."""

import textwrap
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from tautscope.analysis.delayed_play import turns
from tautscope.analysis.models.task import Floats, extremes
from tautscope.analysis.verdict import Verdict
from tautscope.figure_style import BLACK, BLUE, GREY, ORANGE, style

SIZE = (10.0, 5.6)
_FONTS = {
    "font.size": 12,
    "axes.labelsize": 12,
    "axes.titlesize": 12,
    "xtick.labelsize": 10,
    "ytick.labelsize": 10,
    "legend.fontsize": 11,
}
_STROKES, _POINTS = 6, 3000
"""That are drawn: the last strokes of the command."""


def slide(verdict: Verdict) -> Figure:
    """Left the loop of the tip, right the measured and the predicted tip over time.

    The loop is drawn over the reference: the command in the tip's unit, as late as the tip, without
    drift. The tip with the loop is that of the simulation.
    """
    command = verdict.record.command
    at = turns(command, 0.2 * float(np.ptp(command)))
    shown = slice(int(at[-_STROKES - 1]) if len(at) > _STROKES else 0, len(command))
    with style(), matplotlib.rc_context(_FONTS):  # type: ignore[arg-type]  # its stub lists all
        figure = Figure(figsize=SIZE, layout="constrained")
        left, right = figure.subplots(1, 2, width_ratios=(1.15, 1))
        _draw_loop(left, verdict, shown)
        _draw_time(right, verdict, shown)
        figure.suptitle(textwrap.fill(_headline(verdict), 76), x=0.02, ha="left", weight="bold")
    return figure


def _headline(verdict: Verdict) -> str:
    found = verdict.found
    if found.is_identified:
        text = f"{verdict.name}: slack of {verdict.width}"
        if (each := verdict.compensation) is None:
            return text
        return f"{text}; RMS error {each.before:.3g}, with the loop {each.after:.2g}"
    if found.is_aligned:
        return f"{verdict.name}: no slack"
    return f"{verdict.name}: slack not identified: {found.missing}"


def _draw_loop(axes: Axes, verdict: Verdict, shown: slice) -> None:
    record, found = verdict.record, verdict.found
    clock = record.clock
    delayed = np.interp(clock - found.delay.value, clock, record.command)
    known = found.is_identified or found.is_aligned
    x = found.gain * delayed + found.offset if known else record.command
    y = record.measured - found.drift if known else record.measured
    axes.plot(*thinned(x[shown], y[shown]), color=ORANGE, linewidth=1.2, label="tip now")
    axes.set_ylabel(_with_unit("tip", record.units[1]))
    if not known:
        axes.set_xlabel(_with_unit("command", record.units[0]))
        return
    axes.set_xlabel(_with_unit("reference: command times gain", record.units[1]))
    if (each := verdict.compensation) is not None:
        last = slice(-min(len(each.reference), 4 * _POINTS), None)
        axes.plot(
            *thinned(each.reference[last], each.compensated[last]),
            color=BLUE,
            linewidth=1.6,
            label="with the loop, simulated",
        )
        _draw_width(axes, verdict, x[shown], y[shown])
    axes.legend(loc="upper left")


def _draw_width(axes: Axes, verdict: Verdict, x: Floats, y: Floats) -> None:
    """An arrow across the loop in the middle of the tip's range, and the width beside it."""
    width = verdict.found.width.value
    middle = float(np.nanmin(y) + np.nanmax(y)) / 2
    ends = (middle - width / 2, middle), (middle + width / 2, middle)
    axes.annotate("", *ends, arrowprops={"arrowstyle": "<|-|>", "color": BLACK, "shrinkA": 0,
                                         "shrinkB": 0, "linewidth": 1.5})  # fmt: skip
    place = float(np.nanmin(x) + 0.97 * np.ptp(x)), middle - 0.28 * float(np.nanmax(y) - middle)
    axes.annotate(
        f"slack\n{verdict.width}",
        ends[1],
        place,
        ha="right",
        va="top",
        weight="bold",
        arrowprops={"arrowstyle": "-", "color": BLACK, "linewidth": 0.8},
    )


def _draw_time(axes: Axes, verdict: Verdict, shown: slice) -> None:
    record, found = verdict.record, verdict.found
    at = record.clock[shown]
    measured = record.measured[shown]
    seen = np.isfinite(measured)
    axes.plot(*thinned(at[seen], measured[seen]), color=GREY, linewidth=3, label="measured")
    if found.is_related:
        predicted = thinned(at, found.predicted[shown])
        axes.plot(*predicted, color=BLUE, linewidth=1.2, label="predicted")
    axes.set_xlabel("time [s]" if record.is_timed else "sample")
    axes.set_ylabel(_with_unit("tip", record.units[1]))
    axes.margins(x=0)
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2)


def thinned(x: NDArray[Any], y: Floats) -> tuple[NDArray[Any], Floats]:
    """Points (m,) of a line (n,) that looks the same: the extremes of each of many parts."""
    size = max(1, 2 * len(y) // _POINTS)
    kept = extremes(np.nan_to_num(y), size) if size > 2 else np.arange(len(y))
    kept = kept[np.isfinite(y[kept])]
    return x[kept], y[kept]


def _with_unit(text: str, unit: str) -> str:
    return f"{text} [{unit}]" if unit else text
