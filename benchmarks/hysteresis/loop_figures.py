"""Figures of the hysteresis benchmark: loops in the article's protocol, and shared functions."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from hysteresis.measures import period_widths, segment_of
from hysteresis.simulation import Floats
from hysteresis.store import Recordings
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from tautscope.dof import Dof
from tautscope.figure_style import BLACK, BLUE, GREY, ORANGE, PAGE
from tautscope.report import metrics
from tautscope.report.results import evaluate, true_loop

UNCOMPENSATED = "without"
COLOURS = {UNCOMPENSATED: GREY, "paper": ORANGE, "best": BLUE}


@dataclass(frozen=True)
class Finished:
    """Recordings of one scenario, by seed and profile."""

    runs: Mapping[int, Mapping[str, Recordings]]

    @property
    def first(self) -> Mapping[str, Recordings]:
        """Recordings of the first seed, by profile."""
        return self.runs[min(self.runs)]

    def every(self) -> Iterator[tuple[str, Recordings]]:
        """Yield profile and recordings, seed by seed."""
        for of_seed in self.runs.values():
            yield from of_seed.items()


def make_panels(height: float, rows: int = 1, columns: int = 3) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(PAGE, height), layout="constrained")
    return figure, list(figure.subplots(rows, columns, squeeze=False).ravel())


def add_legend(figure: Figure, axes: Axes) -> None:
    lines, labels = axes.get_legend_handles_labels()
    figure.legend(lines, labels, loc="outside lower center", ncols=len(lines))


def share_limits(panels: Sequence[Axes]) -> None:
    """Set common limits of the vertical axis."""
    low, high = zip(*(axes.get_ylim() for axes in panels), strict=True)
    for axes in panels:
        axes.set_ylim(min(low), max(high))


def _settled(finished: Finished, dof: Dof) -> Iterator[tuple[str, Floats, Floats]]:
    """Yield name, reference and true tip of the last two periods: uncompensated, each profile."""
    runs = finished.first
    named = {UNCOMPENSATED: next(iter(runs.values()))["free"]}
    named |= {name: recordings["run"] for name, recordings in runs.items()}
    for name, recording in named.items():
        reference, tip = true_loop(recording, segment_of(recording, dof), "reference")
        yield name, dof.display_scale * reference, dof.display_scale * tip


def loops(finished: Finished) -> Figure:
    """Tip over reference in the last two periods."""
    figure, panels = make_panels(2.75)
    for dof, axes in zip(Dof, panels, strict=True):
        for name, over, tip in _settled(finished, dof):
            axes.plot(over, tip, color=COLOURS[name], linewidth=0.9, label=name)
        axes.set_title(dof.label)
        axes.set_xlabel(f"reference [{dof.display_unit}]")
        axes.set_ylabel(f"tip [{dof.display_unit}]")
        axes.set_box_aspect(0.9)
    add_legend(figure, panels[0])
    return figure


def levels(finished: Finished) -> Figure:
    """Loop width at each tip position."""
    figure, panels = make_panels(2.4)
    for dof, axes in zip(Dof, panels, strict=True):
        for name, over, tip in _settled(finished, dof):
            loop = metrics.loop_width(over, tip)
            axes.plot(loop.levels, loop.widths, color=COLOURS[name], label=name)
            if name == UNCOMPENSATED:
                axes.axhline(0.1 * loop.max, color=BLACK, linewidth=0.5, linestyle="--")
        axes.axhline(0, color=GREY, linewidth=0.4)
        axes.set_title(dof.label)
        axes.set_xlabel(f"tip [{dof.display_unit}]")
        axes.set_ylabel(f"loop width [{dof.display_unit}]")
    add_legend(figure, panels[0])
    return figure


def speeds(finished: Finished) -> Figure:
    """Tip speed over the largest reference speed, last two periods."""
    figure, panels = make_panels(2.3)
    for dof, axes in zip(Dof, panels, strict=True):
        for name, runs in finished.first.items():
            run = runs["run"]
            segment = segment_of(run, dof)
            rows = run.trace[run.during(segment, segment.periods - 2, segment.periods)]
            reference, tip = (np.gradient(rows[f"{x}_{dof.label}"]) for x in ("reference", "true"))
            time = rows["time"] - rows["time"][0]
            axes.plot(
                time, tip / np.abs(reference).max(), color=COLOURS[name], linewidth=0.8, label=name
            )
        scaled = reference / np.abs(reference).max()
        axes.plot(time, scaled, color=BLACK, linewidth=0.8, label="reference")
        for limit in (-2, 2):
            axes.axhline(limit, color=BLACK, linewidth=0.5, linestyle="--")
        axes.set_title(dof.label)
        axes.set_xlabel("time [s]")
    panels[0].set_ylabel("tip speed, relative")
    add_legend(figure, panels[0])
    return figure


def starts(finished: Finished) -> Figure:
    """Loop width of each period over the uncompensated width, every seed."""
    figure, panels = make_panels(2.3)
    for name, runs in finished.every():
        for dof, result in evaluate(runs["free"], runs["run"]).items():
            widths = np.abs(period_widths(runs["run"], segment_of(runs["run"], dof)))
            share, colour = 100 * widths / result.uncompensated, COLOURS[name]
            at = np.arange(1, len(share) + 1)
            panels[dof].semilogy(at, share, "o-", color=colour, markersize=2.5, label=name)
    for dof, axes in zip(Dof, panels, strict=True):
        axes.axhline(5, color=BLACK, linewidth=0.5, linestyle="--")
        axes.set_yticks(ticks := [0.1, 0.3, 1, 3, 10, 30, 100], [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
        axes.set_title(dof.label)
        axes.set_xlabel("period")
    share_limits(panels)
    panels[0].set_ylabel("remaining width [%]")
    by_name = dict(zip(*panels[0].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(by_name.values(), by_name.keys(), loc="outside lower center", ncols=2)
    return figure
