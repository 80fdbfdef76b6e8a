"""The article's Figs. 5 and 9, drawn from recordings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.figure_style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PAGE,
    PURPLE,
    SKY,
    YELLOW,
    style,
)
from tautscope.loop.references import Segment
from tautscope.loop.vision import MarkerDetector
from tautscope.report.results import estimated_loop, true_loop, used_frames
from tautscope.runs.recording import Recording, Snapshot

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

_ON_IMAGE: dict[str, Any] = {
    "loc": "lower right",
    "frameon": True,
    "facecolor": BLACK,
    "framealpha": 0.75,
    "labelcolor": "white",
}
"""Legend over an image."""


def figure9(
    uncompensated: Recording | None, main: Recording, article: Recording | None = None
) -> Figure:
    """The article's Fig. 9: one column per DOF, with the true tip where it is known.

    First row: reference, command, estimate, true tip and both contact offsets over time; second row
    likewise for another compensated run (`article`), if there is one. Last row, the loops: tip over
    command without compensation, over reference with it; a line is the true tip, or the estimate if
    the tip is not known, and dots are the estimate. The first period is thin.
    """
    segments = main.segments
    runs = [main] if article is None else [main, article]
    compared = [*([] if uncompensated is None else [uncompensated]), *runs[::-1]]
    letters = iter("abcdefghi")
    heights = (*[1.0] * len(runs), 1.25)
    with style():
        figure = Figure(figsize=(PAGE, 2.4 * sum(heights)), layout="constrained")
        parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False).ravel()
        for run, part in zip(runs, parts, strict=False):
            axes = part.subplots(1, len(segments), squeeze=False)[0]
            for axis, segment in zip(axes, segments, strict=True):
                _over_time(axis, run, segment)
                how = f"profile {run.config.profile}" if run.compensated else "uncompensated"
                axis.set_title(f"({next(letters)}) {segment.dof.label}, {how}")
            if run is main:
                lines, labels = axes[0].get_legend_handles_labels()
                part.legend(lines, labels, loc="outside upper center", ncols=len(lines))
        axes = parts[-1].subplots(1, len(segments), squeeze=False)[0]
        for axis, segment in zip(axes, segments, strict=True):
            _loops(axis, compared, segment)
            axis.set_title(f"({next(letters)}) {segment.dof.label}")
        handles = list(_loop_legend(compared))
        parts[-1].legend(handles=handles, loc="outside upper center", ncols=len(handles))
    return figure


def _over_time(axes: Axes, recording: Recording, segment: Segment) -> None:
    dof = segment.dof
    trace = recording.trace[recording.during(segment, 0, segment.periods)]
    frames = used_frames(recording, segment)
    for table, clock, name, label, colour, width in (
        (trace, "time", "command", "command c", ORANGE, 0.8),
        (trace, "time", "reference", "reference u", BLACK, 0.8),
        (trace, "time", "true", "true tip", SKY, 2.6),
        (frames, "captured_at", "estimate", "estimate q̂", BLUE, 0.7),
        (trace, "time", "delta_plus", "offset δ⁺", GREEN, 1.1),
        (trace, "time", "delta_minus", "offset δ⁻", PURPLE, 1.1),
    ):
        values = table[f"{name}_{dof.label}"] * dof.display_scale
        if name == "true" and not np.isfinite(values).any():
            continue
        axes.plot(
            table[clock] - trace["time"][0], values, color=colour, linewidth=width, label=label
        )
    axes.set_xlabel("time [s]")
    axes.set_ylabel(f"{dof.label} [{dof.display_unit}]")
    axes.set_xlim(0, segment.period * segment.periods)


def _loops(axes: Axes, runs: list[Recording], segment: Segment) -> None:
    dof = segment.dof
    scale = dof.display_scale
    for run in runs:
        x = "reference" if run.compensated else "command"
        colour = _colour(run, runs)
        tip, settled = (true_loop(run, segment, x, first) for first in (0, 1))
        estimate = estimated_loop(run, segment, x, 1)
        if not np.isfinite(tip[1]).any():
            tip, settled = (estimated_loop(run, segment, x, first) for first in (0, 1))
        start = slice(None, len(tip[0]) - len(settled[0]) + 1)
        axes.plot(*(scale * each for each in settled), color=colour, linewidth=1.0)
        axes.plot(*(scale * each[start] for each in tip), color=colour, linewidth=0.4)
        axes.plot(*(scale * each for each in estimate), ".", color=colour, markersize=1.2)
    if not any(np.size(line.get_xydata()) for line in axes.lines):
        axes.text(0.25, 0.75, "not measured", transform=axes.transAxes, ha="center")
        axes.set(xticks=[], yticks=[])
    low, high = zip(axes.get_xlim(), axes.get_ylim(), strict=True)
    axes.axline((0, 0), slope=1, color=BLACK, linewidth=0.5, linestyle=(0, (4, 4)), zorder=0)
    over = sorted({"u" if run.compensated else "c" for run in runs})
    axes.set_xlabel(f"{' or '.join(over)} [{dof.display_unit}]")
    axes.set_ylabel(f"tip [{dof.display_unit}]")
    axes.set_box_aspect(1)
    axes.set_xlim(min(low), max(high))
    axes.set_ylim(min(low), max(high))


def _colour(run: Recording, runs: list[Recording]) -> str:
    """Of a run in the loops: the last compensated run is blue."""
    if not run.compensated:
        return GREY
    return BLUE if run is runs[-1] else ORANGE


def _loop_legend(runs: list[Recording]) -> Iterator[Artist]:
    for run in runs:
        label = (
            f"{run.config.profile}, over u" if run.compensated else "without compensation, over c"
        )
        yield Line2D([], [], color=_colour(run, runs), label=label)
    is_true = np.isfinite(runs[-1].trace["true_insertion"]).any()
    if is_true:
        yield Line2D([], [], color=BLACK, label="true tip")
    yield Line2D([], [], color=BLACK, linestyle="", marker=".", markersize=3, label="estimate q̂")
    yield Line2D([], [], color=BLACK, linewidth=0.4, label="first period")


def figure5(snapshot: Snapshot, config: Config) -> Figure:
    """The article's Fig. 5: marker detection in one frame.

    (a) the frame, (b) the pixels above the threshold of the discriminant that was used, (c) the
    regions, the markers labelled, (d) measured and predicted features, magnified.
    """
    found = MarkerDetector(config).detect(snapshot.image, snapshot.predicted_features)
    own = config.vision
    used = [(own.weights, own.threshold), *own.alternatives, *own.unlocated.alternatives]
    weights, threshold = used[found.discriminant]
    changed = {"vision.weights": weights, "vision.threshold": threshold}
    mask = MarkerDetector(config.replace(**changed)).mask(snapshot.image)
    image = np.ascontiguousarray(snapshot.image[:, :, ::-1])
    measured, predicted = snapshot.features.reshape(2, 2), snapshot.predicted_features.reshape(2, 2)
    with style():
        figure = Figure(figsize=(PAGE, 6.1), layout="constrained")
        axes = figure.subplots(2, 2).ravel()
        axes[0].imshow(image)
        axes[1].imshow(mask, cmap="gray", interpolation="nearest")
        above = Rectangle((0, 0), 1, 1, facecolor="white", label="above the threshold")
        axes[1].legend(handles=[above], **_ON_IMAGE)
        axes[2].imshow(image // 2)
        for region in found.regions:
            left, top, width, height = region.box
            outline = Rectangle(
                (left - 0.5, top - 0.5), width, height, fill=False, color=SKY, linewidth=1.2
            )
            axes[2].add_patch(outline)
        shown = Rectangle((0, 0), 1, 1, fill=False, color=SKY, label="region of the mask")
        marker = Line2D([], [], color="white", linestyle="", marker="+", label="measured marker")
        axes[2].legend(handles=[shown, marker], **_ON_IMAGE)
        axis_direction = (measured[1] - measured[0]) / np.hypot(*(measured[1] - measured[0]))
        _label_marker(axes[2], "A", measured[0], -axis_direction)
        _label_marker(axes[2], "B", measured[1], axis_direction)
        axes[3].imshow(image)
        axes[3].plot(*predicted.T, "x", color="white", markersize=9, label="predicted s")
        axes[3].plot(
            *measured.T, "o", color=YELLOW, fillstyle="none", markersize=9, label="measured s*"
        )
        for begin, end in zip(predicted, measured, strict=True):
            axes[3].plot(*np.array([begin, end]).T, color="white", linewidth=1.0)
        _magnify(axes[3], np.concatenate([measured, predicted]), image.shape)
        axes[3].legend(**_ON_IMAGE)
        titles = ("frame", "mask", "regions and markers", "features, magnified")
        for axis, letter, title in zip(axes, "abcd", titles, strict=True):
            axis.set_title(f"({letter}) {title}")
            axis.set_axis_off()
    return figure


def _label_marker(
    axes: Axes, name: str, at: NDArray[np.float64], direction: NDArray[np.float64]
) -> None:
    """A cross at a marker [px], its name 26 points off in a direction [px]."""
    axes.plot(*at, "+", color="white", markersize=8)
    axes.annotate(
        name,
        (at[0], at[1]),
        xytext=(26 * direction[0], -26 * direction[1]),
        textcoords="offset points",
        ha="center",
        va="center",
        color=BLACK,
        fontsize=11,
        fontweight="bold",
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
        arrowprops={"arrowstyle": "-", "color": "white", "linewidth": 0.8},
    )


def _magnify(axes: Axes, points: NDArray[np.float64], shape: tuple[int, ...]) -> None:
    """Zoom to the points with a margin, in the aspect ratio of the image."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    span = np.ptp(points, axis=0) + 80
    height = max(span[1], span[0] * shape[0] / shape[1])
    half = np.array([height * shape[1] / shape[0], height]) / 2
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] + half[1], middle[1] - half[1])
