"""Figures of the hysteresis benchmark: traces of the first seed, or dots for every seed."""

from collections.abc import Callable, Collection
from pathlib import Path

from hysteresis import loop_figures as shared
from hysteresis.goals import LATENCIES
from hysteresis.loop_figures import COLOURS, Finished
from hysteresis.measures import uncompensated_width
from hysteresis.scenarios import CHANGING_PERIODS, REST_FOR, STRAIGHT
from matplotlib.figure import Figure
from tautscope.dof import Dof
from tautscope.figure_style import BLACK, BLUE, GREEN, GREY, ORANGE, save_png, style
from tautscope.report.results import evaluate

DOF_COLOURS = (BLUE, ORANGE, GREEN)


def widening(finished: Finished) -> Figure:
    """Estimated slack, and tip minus reference, while the endoscope straightens and bends."""
    figure, (above, below) = shared.make_panels(3.6, 2, 1)
    for name, runs in finished.first.items():
        trace = runs["run"].trace
        estimate = trace["delta_plus_insertion"] - trace["delta_minus_insertion"]
        period = runs["run"].segments[0].period
        time, colour = trace["time"] / period, COLOURS[name]
        error = trace["true_insertion"] - trace["reference_insertion"]
        above.plot(time, 1e3 * estimate, color=colour, label=f"estimate, {name}")
        below.plot(time, 1e3 * error, color=colour, linewidth=0.8, label=name)
    bent, straight = (1e3 * uncompensated_width(runs[name]) for name in ("bent", "straight"))
    at = [0, *STRAIGHT, CHANGING_PERIODS]
    above.plot(
        at,
        [bent, bent, straight, straight, bent, bent],
        color=BLACK,
        linestyle="--",
        label="of the loop without compensation",
    )
    above.set_ylabel("slack of insertion [mm]")
    below.set_ylabel("tip minus reference [mm]")
    below.set_xlabel("period")
    above.legend(ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1.22))
    return figure


def overestimated(finished: Finished) -> Figure:
    """Reference and tip, and their difference, from a start value 50 % too wide."""
    figure, (signals, errors) = shared.make_panels(2.4, 1, 2)
    for name, runs in finished.first.items():
        trace, period = runs["run"].trace, runs["run"].segments[0].period
        time = trace["time"] / period
        reference, tip = (1e3 * trace[f"{x}_insertion"] for x in ("reference", "true"))
        signals.plot(time, tip, color=COLOURS[name], label=f"tip, {name}")
        errors.plot(time, tip - reference, color=COLOURS[name], linewidth=0.8, label=name)
    signals.plot(time, reference, color=BLACK, linewidth=0.7, linestyle="--", label="reference")
    signals.set_ylabel("insertion [mm]")
    errors.set_ylabel("tip minus reference [mm]")
    for axes in (signals, errors):
        axes.set_xlabel("period")
    shared.add_legend(figure, signals)
    return figure


def shaking(finished: Finished) -> Figure:
    """Reference, command and tip around the time at which the intended motion stops."""
    figure, panels = shared.make_panels(2.6, 1, len(finished.first))
    for (name, runs), axes in zip(finished.first.items(), panels, strict=True):
        trace = runs["1 mm"].trace
        rest = trace["time"][-1] - REST_FOR
        rows = trace[(trace["time"] > rest - 1) & (trace["time"] < rest + 2)]
        middle = rows["reference_insertion"][-1]
        for x, label, colour in (
            ("command", "command", ORANGE),
            ("true", "tip", BLUE),
            ("reference", "reference", BLACK),
        ):
            moved = 1e3 * (rows[f"{x}_insertion"] - middle)
            axes.plot(rows["time"] - rest, moved, color=colour, linewidth=0.8, label=label)
        axes.axvline(0, color=GREY, linewidth=0.5)
        axes.set_title(name)
        axes.set_xlabel("time since the intended motion stopped [s]")
        axes.set_ylabel("insertion [mm]")
    shared.share_limits(panels)
    shared.add_legend(figure, panels[0])
    return figure


def delays(finished: Finished) -> Figure:
    """Reduction over latency, every seed."""
    figure, panels = shared.make_panels(2.3)
    config = next(iter(finished.first.values()))["run"].config
    places = {"run": 1e3 * config.twin.latency} | {
        name: 1e3 * value for name, value in LATENCIES.items()
    }
    places = dict(sorted(places.items(), key=lambda item: item[1]))
    for name, runs in finished.every():
        found = {key: evaluate(runs["free"], runs[key]) for key in places}
        for dof, axes in zip(Dof, panels, strict=True):
            share = [100 * found[key][dof].reduction for key in places]
            axes.plot(list(places.values()), share, "o-", color=COLOURS[name], markersize=2.5)
    for dof, axes in zip(Dof, panels, strict=True):
        axes.set_title(dof.label)
        axes.set_xlabel("latency [ms]")
    shared.share_limits(panels)
    panels[0].set_ylabel("reduction [%]")
    for name in finished.first:
        panels[0].plot([], [], "o-", color=COLOURS[name], markersize=2.5, label=name)
    shared.add_legend(figure, panels[0])
    return figure


def disturbed(finished: Finished) -> Figure:
    """Reduction under each image condition, every seed."""
    names = [key for key in finished.first["best"] if key != "free"]
    figure, (axes,) = shared.make_panels(0.23 * len(names) + 0.8, 1, 1)
    for _, runs in finished.every():
        for row, name in enumerate(names):
            for dof, result in evaluate(runs["free"], runs[name]).items():
                place = row + 0.2 * (dof - 1)
                axes.plot(
                    100 * result.reduction,
                    place,
                    "o",
                    color=DOF_COLOURS[dof],
                    markersize=3,
                )
    for dof in Dof:
        axes.plot([], [], "o", color=DOF_COLOURS[dof], markersize=3, label=dof.label)
    axes.set_yticks(range(len(names)), ["clean", *names[1:]])
    axes.invert_yaxis()
    axes.grid(axis="y", linewidth=0.3)
    axes.set_xlabel("reduction [%]")
    shared.add_legend(figure, axes)
    return figure


FIGURES: dict[str, tuple[str, str, Callable[[Finished], Figure]]] = {
    "reduction": (
        "alone",
        "Reduction of the mean width: tip over reference, last two periods",
        shared.loops,
    ),
    "max-width": (
        "alone",
        "Reduction of the largest width: loop width over tip position; dashed, a tenth of the "
        "largest without compensation",
        shared.levels,
    ),
    "overspeed": (
        "alone",
        "Tip speed over the largest speed of the reference, every tick of the last two periods; "
        "dashed, the goal",
        shared.speeds,
    ),
    "start": ("alone", "Start: width of each period; dashed, a reduction of 95 %", shared.starts),
    "together": ("together", "Three DOFs at once: tip over reference", shared.loops),
    "width-change": ("changing", "Width 10-2-10 mm", widening),
    "too-wide": ("too wide", "Start value 50 % too wide", overestimated),
    "latency": ("latency", "Latency, timestamps exact", delays),
    "tremor": (
        "tremor",
        "Tremor of 2 mm at 10 Hz; the reference stops 1 mm after a reversal",
        shaking,
    ),
    "conditions": ("conditions", "Image conditions, each through the whole loop", disturbed),
}
"""File name: scenario, caption, and function that draws it."""


def draw(folder: Path, groups: Collection[str], load: Callable[[str], Finished]) -> list[str]:
    """Draw the figures of these scenarios as PNG files and return their names."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = []
    for name, (group, _, make) in FIGURES.items():
        if group in groups:
            with style():
                save_png(make(load(group)), folder / f"{name}.png", dpi=240)
            drawn.append(name)
    return drawn
