"""One figure per row of the hysteresis benchmark: the first seed's traces, or every seed's dots."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from hysteresis_goals import LATENCIES
from hysteresis_rows import (
    CHANGING_PERIODS,
    REST_FOR,
    STRAIGHT,
    gone,
    own,
    true_width,
    widths,
)
from hysteresis_runs import Floats, Recordings
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from tautscope.dof import Dof
from tautscope.report import metrics
from tautscope.report.figures import BLACK, BLUE, GREEN, GREY, ORANGE, PAGE, style
from tautscope.report.results import evaluate, true_loop

PLAIN = "without"
COLOURS = {PLAIN: GREY, "paper": ORANGE, "best": BLUE}
DOF_COLOURS = (BLUE, ORANGE, GREEN)


@dataclass(frozen=True)
class Finished:
    """What was run: per seed and profile the recordings of one group."""

    runs: Mapping[int, Mapping[str, Recordings]]

    @property
    def first(self) -> Mapping[str, Recordings]:
        """Of the first seed, by profile."""
        return self.runs[min(self.runs)]

    def every(self) -> Iterator[tuple[str, Recordings]]:
        """Profile and recordings, seed by seed."""
        for of_seed in self.runs.values():
            yield from of_seed.items()


def _panels(height: float, rows: int = 1, columns: int = 3) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(PAGE, height), layout="constrained")
    return figure, list(figure.subplots(rows, columns, squeeze=False).ravel())


def _legend(figure: Figure, axes: Axes) -> None:
    lines, labels = axes.get_legend_handles_labels()
    figure.legend(lines, labels, loc="outside lower center", ncols=len(lines))


def _same_height(panels: Sequence[Axes]) -> None:
    """One scale for all."""
    low, high = zip(*(axes.get_ylim() for axes in panels), strict=True)
    for axes in panels:
        axes.set_ylim(min(low), max(high))


def _settled(finished: Finished, dof: Dof) -> Iterator[tuple[str, Floats, Floats]]:
    """Name, hand and true tip in a DOF's last two periods: without compensation, each profile."""
    runs = finished.first
    named = {PLAIN: next(iter(runs.values()))["free"]}
    named |= {name: recordings["run"] for name, recordings in runs.items()}
    for name, recording in named.items():
        hand, tip = true_loop(recording, own(recording, dof), "reference")
        yield name, dof.display_scale * hand, dof.display_scale * tip


def loops(finished: Finished) -> Figure:
    """Tip over hand in the last two periods."""
    figure, panels = _panels(2.75)
    for dof, axes in zip(Dof, panels, strict=True):
        for name, over, tip in _settled(finished, dof):
            axes.plot(over, tip, color=COLOURS[name], linewidth=0.9, label=name)
        axes.set_title(dof.label)
        axes.set_xlabel(f"hand [{dof.display_unit}]")
        axes.set_ylabel(f"tip [{dof.display_unit}]")
        axes.set_box_aspect(0.9)
    _legend(figure, panels[0])
    return figure


def levels(finished: Finished) -> Figure:
    """Width of the loop at each level of the tip."""
    figure, panels = _panels(2.4)
    for dof, axes in zip(Dof, panels, strict=True):
        for name, over, tip in _settled(finished, dof):
            loop = metrics.loop_width(over, tip)
            axes.plot(loop.levels, loop.widths, color=COLOURS[name], label=name)
            if name == PLAIN:
                axes.axhline(0.1 * loop.max, color=BLACK, linewidth=0.5, linestyle="--")
        axes.axhline(0, color=GREY, linewidth=0.4)
        axes.set_title(dof.label)
        axes.set_xlabel(f"tip [{dof.display_unit}]")
        axes.set_ylabel(f"loop's width [{dof.display_unit}]")
    _legend(figure, panels[0])
    return figure


def speeds(finished: Finished) -> Figure:
    """Tip's speed over the hand's largest, last two periods."""
    figure, panels = _panels(2.3)
    for dof, axes in zip(Dof, panels, strict=True):
        for name, runs in finished.first.items():
            run = runs["run"]
            segment = own(run, dof)
            rows = run.trace[run.during(segment, segment.periods - 2, segment.periods)]
            hand, tip = (np.gradient(rows[f"{x}_{dof.label}"]) for x in ("reference", "true"))
            time = rows["time"] - rows["time"][0]
            axes.plot(
                time, tip / np.abs(hand).max(), color=COLOURS[name], linewidth=0.8, label=name
            )
        axes.plot(time, hand / np.abs(hand).max(), color=BLACK, linewidth=0.8, label="hand")
        for limit in (-2, 2):
            axes.axhline(limit, color=BLACK, linewidth=0.5, linestyle="--")
        axes.set_title(dof.label)
        axes.set_xlabel("time [s]")
    panels[0].set_ylabel("tip's speed over hand's largest")
    _legend(figure, panels[0])
    return figure


def starts(finished: Finished) -> Figure:
    """Width of each period over the uncompensated one, every seed."""
    figure, panels = _panels(2.3)
    for name, runs in finished.every():
        for dof, result in evaluate(runs["free"], runs["run"]).items():
            left = 100 * np.abs(widths(runs["run"], own(runs["run"], dof))) / result.uncompensated
            at = np.arange(1, len(left) + 1)
            panels[dof].semilogy(at, left, "o-", color=COLOURS[name], markersize=2.5, label=name)
    for dof, axes in zip(Dof, panels, strict=True):
        axes.axhline(5, color=BLACK, linewidth=0.5, linestyle="--")
        axes.set_yticks(ticks := [0.1, 0.3, 1, 3, 10, 30, 100], [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
        axes.set_title(dof.label)
        axes.set_xlabel("period")
    _same_height(panels)
    panels[0].set_ylabel("width left [%]")
    by_name = dict(zip(*panels[0].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(by_name.values(), by_name.keys(), loc="outside lower center", ncols=2)
    return figure


def widening(finished: Finished) -> Figure:
    """Estimated width, and tip less hand, while the scope straightens and bends."""
    figure, (above, below) = _panels(3.6, 2, 1)
    for name, runs in finished.first.items():
        trace = runs["run"].trace
        estimate = trace["delta_plus_insertion"] - trace["delta_minus_insertion"]
        period = runs["run"].segments[0].period
        time, colour = trace["time"] / period, COLOURS[name]
        error = trace["true_insertion"] - trace["reference_insertion"]
        above.plot(time, 1e3 * estimate, color=colour, label=f"estimate, {name}")
        below.plot(time, 1e3 * error, color=colour, linewidth=0.8, label=name)
    bent, straight = (1e3 * true_width(runs[name]) for name in ("bent", "straight"))
    at = [0, *STRAIGHT, CHANGING_PERIODS]
    above.plot(
        at,
        [bent, bent, straight, straight, bent, bent],
        color=BLACK,
        linestyle="--",
        label="of the loop without compensation",
    )
    above.set_ylabel("insertion's width [mm]")
    below.set_ylabel("tip less hand [mm]")
    below.set_xlabel("period")
    above.legend(ncols=3, loc="upper center", bbox_to_anchor=(0.5, 1.22))
    return figure


def overestimated(finished: Finished) -> Figure:
    """Hand and tip, and their difference, from a start value 50 % too wide."""
    figure, (signals, errors) = _panels(2.4, 1, 2)
    for name, runs in finished.first.items():
        trace, period = runs["run"].trace, runs["run"].segments[0].period
        time = trace["time"] / period
        hand, tip = (1e3 * trace[f"{x}_insertion"] for x in ("reference", "true"))
        signals.plot(time, tip, color=COLOURS[name], label=f"tip, {name}")
        errors.plot(time, tip - hand, color=COLOURS[name], linewidth=0.8, label=name)
    signals.plot(time, hand, color=BLACK, linewidth=0.7, linestyle="--", label="hand")
    signals.set_ylabel("insertion [mm]")
    errors.set_ylabel("tip less hand [mm]")
    for axes in (signals, errors):
        axes.set_xlabel("period")
    _legend(figure, signals)
    return figure


def shaking(finished: Finished) -> Figure:
    """Hand, motor and tip about the moment the hand comes to rest."""
    figure, panels = _panels(2.6, 1, len(finished.first))
    for (name, runs), axes in zip(finished.first.items(), panels, strict=True):
        trace = runs["1 mm"].trace
        rest = trace["time"][-1] - REST_FOR
        rows = trace[(trace["time"] > rest - 1) & (trace["time"] < rest + 2)]
        middle = rows["reference_insertion"][-1]
        for x, label, colour in (
            ("command", "motor", ORANGE),
            ("true", "tip", BLUE),
            ("reference", "hand", BLACK),
        ):
            moved = 1e3 * (rows[f"{x}_insertion"] - middle)
            axes.plot(rows["time"] - rest, moved, color=colour, linewidth=0.8, label=label)
        axes.axvline(0, color=GREY, linewidth=0.5)
        axes.set_title(name)
        axes.set_xlabel("time since the hand rests [s]")
        axes.set_ylabel("insertion [mm]")
    _same_height(panels)
    _legend(figure, panels[0])
    return figure


def delays(finished: Finished) -> Figure:
    """Reduction over latency, every seed."""
    figure, panels = _panels(2.3)
    config = next(iter(finished.first.values()))["run"].config
    places = {"run": 1e3 * config.twin.latency} | {
        name: 1e3 * value for name, value in LATENCIES.items()
    }
    places = dict(sorted(places.items(), key=lambda item: item[1]))
    for name, runs in finished.every():
        found = {key: evaluate(runs["free"], runs[key]) for key in places}
        for dof, axes in zip(Dof, panels, strict=True):
            share = [100 * gone(found[key][dof].reduction) for key in places]
            axes.plot(list(places.values()), share, "o-", color=COLOURS[name], markersize=2.5)
    for dof, axes in zip(Dof, panels, strict=True):
        axes.set_title(dof.label)
        axes.set_xlabel("latency [ms]")
    _same_height(panels)
    panels[0].set_ylabel("reduction [%]")
    for name in finished.first:
        panels[0].plot([], [], "o-", color=COLOURS[name], markersize=2.5, label=name)
    _legend(figure, panels[0])
    return figure


def disturbed(finished: Finished) -> Figure:
    """Reduction under each condition, every seed."""
    names = [key for key in finished.first["best"] if key != "free"]
    figure, (axes,) = _panels(0.23 * len(names) + 0.8, 1, 1)
    for _, runs in finished.every():
        for row, name in enumerate(names):
            for dof, result in evaluate(runs["free"], runs[name]).items():
                place = row + 0.2 * (dof - 1)
                axes.plot(
                    100 * gone(result.reduction), place, "o", color=DOF_COLOURS[dof], markersize=3
                )
    for dof in Dof:
        axes.plot([], [], "o", color=DOF_COLOURS[dof], markersize=3, label=dof.label)
    axes.set_yticks(range(len(names)), ["clean", *names[1:]])
    axes.invert_yaxis()
    axes.grid(axis="y", linewidth=0.3)
    axes.set_xlabel("reduction [%]")
    _legend(figure, axes)
    return figure


FIGURES: dict[str, tuple[str, str, Callable[[Finished], Figure]]] = {
    "reduction": ("alone", "Reduction of the mean width: tip over hand, last two periods", loops),
    "max-width": (
        "alone",
        "Reduction of the largest width: the loop's width over the tip's place; dashed, a tenth "
        "of the largest without compensation",
        levels,
    ),
    "overspeed": ("alone", "Tip overspeed: last two periods; dashed, the goal", speeds),
    "start": ("alone", "Start: width of each period; dashed, a reduction of 95 %", starts),
    "together": ("together", "Three DOFs at once: tip over hand", loops),
    "width-change": ("changing", "Width 10-2-10 mm", widening),
    "too-wide": ("too wide", "Start value 50 % too wide", overestimated),
    "latency": ("latency", "Latency, timestamps exact", delays),
    "tremor": ("tremor", "Tremor of 2 mm at 10 Hz; the hand rests 1 mm after a reversal", shaking),
    "conditions": ("conditions", "Image conditions, each through the whole loop", disturbed),
}
"""File name: group of runs, caption, and what draws it."""


def draw(folder: Path, groups: Collection[str], load: Callable[[str], Finished]) -> list[str]:
    """Draw the figures of these groups as PNG into a folder; the names of those drawn."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = []
    for name, (group, _, make) in FIGURES.items():
        if group in groups:
            with style():
                make(load(group)).savefig(folder / f"{name}.png", dpi=120)
            drawn.append(name)
    return drawn
