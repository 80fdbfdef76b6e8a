"""The figure of the operator motion."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator

from tautscope.dof import Dof
from tautscope.figure_style import BLACK, BLUE, GREY, ORANGE, PAGE, style
from tautscope.report.operator_motion import EVALUATED_AFTER
from tautscope.runs.recording import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WINDOW = 20.0
"""Part of the run in which the signals are drawn, from `EVALUATED_AFTER` on [s]."""


def draw_operator_motion(uncompensated: Recording, compensated: Recording) -> Figure:
    """The operator motion: one row per DOF.

    (a)-(c): reference, command and true tip over 20 s, the tip also without compensation.
    (d)-(f): tracking error of the true tip over the whole run, without and with compensation.
    """
    with style():
        figure = Figure(figsize=(PAGE, 6.0), layout="constrained")
        panels = figure.subplots(len(Dof), 2, sharex="col", width_ratios=(1.25, 1))
        for dof, (signals, errors), letters in zip(Dof, panels, ("ad", "be", "cf"), strict=True):
            _draw_signals(signals, uncompensated, compensated, dof)
            _draw_errors(errors, uncompensated, compensated, dof)
            signals.set_title(f"({letters[0]}) {dof.label}")
            errors.set_title(f"({letters[1]}) tracking error of {dof.label}")
        for axes in panels[-1]:
            axes.set_xlabel("time [s]")
        panels[0, 1].annotate(
            "not evaluated",
            (EVALUATED_AFTER / 2, 0.99),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="top",
            color=GREY,
            fontsize=7,
        )
        figure.align_ylabels(panels)
        lines, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(lines, labels, loc="outside upper center", ncols=len(lines))
    return figure


def _draw_signals(axes: Axes, uncompensated: Recording, compensated: Recording, dof: Dof) -> None:
    for recording, name, label, colour, width in (
        (uncompensated, "true", "tip without compensation", GREY, 1.0),
        (compensated, "command", "command", ORANGE, 0.7),
        (compensated, "true", "tip with compensation", BLUE, 1.2),
        (compensated, "reference", "reference", BLACK, 0.8),
    ):
        time = recording.trace["time"] - recording.trace["time"][0]
        rows = (time >= EVALUATED_AFTER) & (time <= EVALUATED_AFTER + WINDOW)
        axes.plot(
            time[rows],
            recording.trace[f"{name}_{dof.label}"][rows] * dof.display_scale,
            color=colour,
            linewidth=width,
            label=label,
            linestyle="--" if name == "reference" else "-",
        )
    axes.set_ylabel(f"{dof.label} [{dof.display_unit}]")
    axes.xaxis.set_major_locator(MultipleLocator(5))
    axes.set_xlim(EVALUATED_AFTER, EVALUATED_AFTER + WINDOW)


def _draw_errors(axes: Axes, uncompensated: Recording, compensated: Recording, dof: Dof) -> None:
    for recording, colour in ((uncompensated, GREY), (compensated, BLUE)):
        trace = recording.trace
        time = trace["time"] - trace["time"][0]
        error = trace[f"true_{dof.label}"] - trace[f"reference_{dof.label}"]
        axes.plot(time, error * dof.display_scale, color=colour, linewidth=0.7)
    axes.axhline(0, color=BLACK, linewidth=0.5, linestyle=(0, (4, 4)))
    axes.axvspan(0, EVALUATED_AFTER, color="#eeeeee", linewidth=0, zorder=0)
    axes.set_ylabel(f"error [{dof.display_unit}]")
    axes.set_xlim(0, math.ceil(time[-1]))
