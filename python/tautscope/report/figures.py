"""Figures in one style, with colours that colour-blind readers can distinguish.

They do not use pyplot's global state, a display or a file.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from tautscope.config import Config
from tautscope.loop.references import Segment
from tautscope.loop.vision import MarkerDetector
from tautscope.report.results import estimated_loop, used_frames
from tautscope.runs.recording import Recording, Snapshot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BLACK, GREY = "#222222", "#8a8a8a"
BLUE, ORANGE, GREEN, PURPLE = "#0072b2", "#d55e00", "#009e73", "#aa4499"
"""After Okabe and Ito (2008)."""

COLUMN, PAGE = 3.5, 7.2
"""Widths of a column and of a page [inch]."""

_STYLE: dict[str, Any] = {
    "font.size": 8,
    "font.family": "DejaVu Sans",
    "axes.titlesize": 8,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "legend.fontsize": 7,
    "legend.frameon": False,
    "lines.linewidth": 1.0,
    "figure.constrained_layout.w_pad": 0.08,
    "savefig.dpi": 200,
    "pdf.fonttype": 42,
}


@contextmanager
def style() -> Iterator[None]:
    """Context in which figures are made and saved in the package's style."""
    with matplotlib.rc_context(_STYLE):  # type: ignore[arg-type]  # its stub lists every key
        yield


def figure9(uncompensated: Recording | None, compensated: Recording) -> Figure:
    """The article's Fig. 9: one column per DOF.

    (a)-(c): reference, command, estimate and both contact offsets over time, with compensation.
    (d)-(f): estimate over command without (if run) and over reference with compensation, the first
    period thin.
    """
    segments = compensated.segments
    with style():
        figure = Figure(figsize=(PAGE, 5.3), layout="constrained")
        upper, lower = figure.subfigures(2, 1, height_ratios=(1, 1.12), squeeze=False).flat
        for part, letters in ((upper, "abc"), (lower, "def")):
            axes = part.subplots(1, len(segments), squeeze=False)[0]
            for axis, letter, segment in zip(axes, letters, segments, strict=False):
                if part is upper:
                    _over_time(axis, compensated, segment)
                else:
                    _loops(axis, uncompensated, compensated, segment)
                axis.set_title(f"({letter}) {segment.dof.label}")
            lines, labels = axes[0].get_legend_handles_labels()
            part.legend(lines, labels, loc="outside upper center", ncols=len(lines))
    return figure


def _over_time(axes: Axes, recording: Recording, segment: Segment) -> None:
    dof = segment.dof
    trace = recording.trace[recording.during(segment, 0, segment.periods)]
    frames = used_frames(recording, segment)
    for table, clock, name, label, colour, width in (
        (trace, "time", "command", "command c", ORANGE, 0.8),
        (trace, "time", "reference", "reference u", BLACK, 0.8),
        (frames, "captured_at", "estimate", "estimate q̂", BLUE, 1.1),
        (trace, "time", "delta_plus", "offset δ⁺", GREEN, 1.1),
        (trace, "time", "delta_minus", "offset δ⁻", PURPLE, 1.1),
    ):
        axes.plot(
            table[clock] - trace["time"][0],
            table[f"{name}_{dof.label}"] * dof.display_scale,
            color=colour,
            linewidth=width,
            label=label,
        )
    axes.set_xlabel("time [s]")
    axes.set_ylabel(f"{dof.label} [{dof.display_unit}]")
    axes.set_xlim(0, segment.period * segment.periods)


def _loops(
    axes: Axes, uncompensated: Recording | None, compensated: Recording, segment: Segment
) -> None:
    dof = segment.dof
    scale = dof.display_scale
    for recording, name, label, colour, width in (
        (uncompensated, "command", "uncompensated: q̂ over c", GREY, 1.0),
        (compensated, "reference", "compensated: q̂ over u", BLUE, 1.0),
        (compensated, "reference", "compensated, first period", BLUE, 0.4),
    ):
        if recording is None:
            continue
        x, y = estimated_loop(recording, segment, name, first=0)
        if recording is compensated:
            settled, _ = estimated_loop(recording, segment, name, first=1)
            begin = len(x) - len(settled)
            shown = slice(begin, None) if width == 1.0 else slice(begin + 1)
            x, y = x[shown], y[shown]
        axes.plot(x * scale, y * scale, color=colour, linewidth=width, label=label)
    if not any(np.size(line.get_xydata()) for line in axes.lines):
        axes.text(0.25, 0.75, "not measured", transform=axes.transAxes, ha="center")
        axes.set(xticks=[], yticks=[])
    low, high = zip(axes.get_xlim(), axes.get_ylim(), strict=True)
    axes.axline((0, 0), slope=1, color=BLACK, linewidth=0.5, linestyle=(0, (4, 4)), zorder=0)
    axes.set_xlabel(f"{'u' if uncompensated is None else 'c or u'} [{dof.display_unit}]")
    axes.set_ylabel(f"estimate q̂ [{dof.display_unit}]")
    axes.set_box_aspect(1)
    axes.set_xlim(min(low), max(high))
    axes.set_ylim(min(low), max(high))


def figure5(snapshot: Snapshot, config: Config) -> Figure:
    """The article's Fig. 5: marker detection in one frame.

    (a) the frame, (b) the pixels above the discriminant's threshold, (c) the regions, the markers
    labelled, (d) measured and predicted features, magnified.
    """
    detector = MarkerDetector(config)
    regions = detector.detect(snapshot.image, snapshot.predicted_features).regions
    image = np.ascontiguousarray(snapshot.image[:, :, ::-1])
    measured, predicted = snapshot.features.reshape(2, 2), snapshot.predicted_features.reshape(2, 2)
    with style():
        figure = Figure(figsize=(PAGE, 6.1), layout="constrained")
        axes = figure.subplots(2, 2).ravel()
        axes[0].imshow(image)
        axes[1].imshow(detector.mask(snapshot.image), cmap="gray", interpolation="nearest")
        axes[2].imshow(image // 2 + 96)
        for region in regions:
            left, top, width, height = region.box
            outline = Rectangle(
                (left - 0.5, top - 0.5), width, height, fill=False, color=ORANGE, linewidth=1.0
            )
            axes[2].add_patch(outline)
        axis_direction = (measured[1] - measured[0]) / np.hypot(*(measured[1] - measured[0]))
        _label_marker(axes[2], "A", measured[0], -axis_direction)
        _label_marker(axes[2], "B", measured[1], axis_direction)
        axes[3].imshow(image)
        axes[3].plot(*predicted.T, "x", color="white", markersize=9, label="predicted s")
        axes[3].plot(
            *measured.T, "o", color=ORANGE, fillstyle="none", markersize=9, label="measured s*"
        )
        for begin, end in zip(predicted, measured, strict=True):
            axes[3].plot(*np.array([begin, end]).T, color="white", linewidth=1.0)
        _magnify(axes[3], np.concatenate([measured, predicted]), image.shape)
        axes[3].legend(loc="lower right", frameon=True, facecolor="#555555", labelcolor="white")
        titles = ("frame", "mask", "regions and markers", "features, magnified")
        for axis, letter, title in zip(axes, "abcd", titles, strict=True):
            axis.set_title(f"({letter}) {title}")
            axis.set_axis_off()
    return figure


def _label_marker(
    axes: Axes, name: str, at: NDArray[np.float64], away: NDArray[np.float64]
) -> None:
    """A cross at a marker [px], its name 26 points off in the direction `away` [px]."""
    axes.plot(*at, "+", color=BLACK, markersize=8)
    axes.annotate(
        name,
        (at[0], at[1]),
        xytext=(26 * away[0], -26 * away[1]),
        textcoords="offset points",
        ha="center",
        va="center",
        color=BLACK,
        fontsize=11,
        fontweight="bold",
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
        arrowprops={"arrowstyle": "-", "color": BLACK, "linewidth": 0.8},
    )


def _magnify(axes: Axes, points: NDArray[np.float64], shape: tuple[int, ...]) -> None:
    """Zoom to the points with a margin, in the aspect ratio of the image."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    span = np.ptp(points, axis=0) + 80
    height = max(span[1], span[0] * shape[0] / shape[1])
    half = np.array([height * shape[1] / shape[0], height]) / 2
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] + half[1], middle[1] - half[1])
