"""The figure of the operator motion."""

from __future__ import annotations

import math
from string import ascii_lowercase
from typing import TYPE_CHECKING

from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from tautscope.dof import NamedDof
from tautscope.figure_style import BLACK, BLUE, GREY, ORANGE, PAGE, style
from tautscope.report.operator_motion import evaluated_after, tip_and_reference
from tautscope.runs.recording import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Runs = list[tuple[Recording, str]]
"""Recordings with their colours; the last is the one whose command is drawn."""
WINDOW = 20.0
"""Part of the run in which the signals are drawn, from the start of the evaluation on [s]."""


def draw_operator_motion(uncompensated: Recording | None, main: Recording) -> Figure:
    """The operator motion of a run, and of one without compensation: one row per DOF.

    Left: reference, command and tip over 20 s, the tip also without compensation.
    Right: tracking error of the tip over the whole run, without and with compensation.
    The tip is the true one where it is known, else the one measured.
    """
    runs = [(uncompensated, GREY)] if uncompensated is not None else []
    runs.append((main, BLUE if main.compensated else GREY))
    begin = evaluated_after(main)
    end = float(main.trace["time"][-1] - main.trace["time"][0])
    with style():
        dofs = main.config.dofs
        figure = Figure(figsize=(PAGE, 2.0 * len(dofs) + 0.2), layout="constrained")
        panels = figure.subplots(len(dofs), 2, sharex="col", squeeze=False, width_ratios=(1.25, 1))
        letters_of = zip(ascii_lowercase, ascii_lowercase[len(dofs) :], strict=False)
        for dof, (signals, errors), letters in zip(dofs, panels, letters_of, strict=False):
            _draw_signals(signals, runs, dof)
            signals.set_xlim(begin, min(begin + WINDOW, end))
            _draw_errors(errors, runs, dof)
            errors.axvspan(0, begin, color="#eeeeee", linewidth=0, zorder=0)
            signals.set_title(f"({letters[0]}) {dof.label}")
            errors.set_title(f"({letters[1]}) tracking error of {dof.label}")
        for axes in panels[-1]:
            axes.set_xlabel("time [s]")
        panels[0, 1].annotate(
            "not evaluated",
            (begin / 2, 0.99),
            xycoords=("data", "axes fraction"),
            ha="center",
            va="top",
            color=GREY,
            fontsize=7,
            bbox={"facecolor": "#eeeeee", "edgecolor": "none", "pad": 1},
        )
        figure.align_ylabels(panels)
        lines, labels = panels[0, 0].get_legend_handles_labels()
        figure.legend(lines, labels, loc="outside upper center", ncols=len(lines))
    return figure


def _draw_signals(axes: Axes, runs: Runs, dof: NamedDof) -> None:
    trace = runs[-1][0].trace
    time = trace["time"] - trace["time"][0]
    for recording, colour in runs:
        stamps, tip, _ = tip_and_reference(recording, dof)
        elapsed, shown = stamps - recording.trace["time"][0], tip * dof.display_scale
        label = f"tip {'with' if recording.compensated else 'without'} compensation"
        axes.plot(elapsed, shown, color=colour, linewidth=1.1, label=label)
    for name, colour, width, line in ("command", ORANGE, 0.7, "-"), ("reference", BLACK, 0.8, "--"):
        shown = trace[f"{name}_{dof.label}"] * dof.display_scale
        axes.plot(time, shown, line, color=colour, linewidth=width, label=name)
    axes.set_ylabel(f"{dof.label} [{dof.display_unit}]")
    axes.xaxis.set_major_locator(MaxNLocator("auto", integer=True, steps=[1, 2, 5, 10]))


def _draw_errors(axes: Axes, runs: Runs, dof: NamedDof) -> None:
    for recording, colour in runs:
        time, tip, reference = tip_and_reference(recording, dof)
        elapsed, errors = time - recording.trace["time"][0], (tip - reference) * dof.display_scale
        axes.plot(elapsed, errors, color=colour, linewidth=0.7)
    axes.axhline(0, color=BLACK, linewidth=0.5, linestyle=(0, (4, 4)))
    axes.set_ylabel(f"error [{dof.display_unit}]")
    axes.set_xlim(0, math.ceil(recording.trace["time"][-1] - recording.trace["time"][0]))
