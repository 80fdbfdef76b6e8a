"""What a replay estimated beside what the run did: figures per DOF, and a picture."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from tautscope.dof import Dof
from tautscope.report import metrics
from tautscope.runs.output_folder import new_folder
from tautscope.runs.recording import Recording, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAN = float("nan")


@dataclass(frozen=True, slots=True)
class Estimation:
    """How one DOF was estimated in a run [m or rad]; NaN is not known.

    Attributes:
        width: Slack at the end, delta_plus - delta_minus.
        seen: Share of the images that determined the DOF.
        state_rms: RMS of estimate minus truth over those, if there is a truth.
        change_rms: RMS of this estimate minus that of the run it is compared with, over the images
            that determined the DOF in both.
    """

    width: float
    seen: float
    state_rms: float
    change_rms: float


def estimations(run: Recording, other: Recording | None = None) -> dict[Dof, Estimation]:
    """The figures of a run, compared with another of the same images."""
    return {dof: _estimation(run, other, dof) for dof in Dof}


def _estimation(run: Recording, other: Recording | None, dof: Dof) -> Estimation:
    frames, name = run.frames, dof.label
    seen = frames[f"observable_{name}"]
    error = (frames[f"estimate_{name}"] - frames[f"true_{name}"])[seen]
    error = error[np.isfinite(error)]
    change = np.empty(0)
    if other is not None:
        _, mine, theirs = np.intersect1d(
            frames["sequence"], other.frames["sequence"], return_indices=True
        )
        both = seen[mine] & other.frames[f"observable_{name}"][theirs]
        values = [
            table[f"estimate_{name}"][rows][both]
            for table, rows in ((frames, mine), (other.frames, theirs))
        ]
        change = values[0] - values[1]
    return Estimation(
        width=float(_width(run.trace[-1:], name)[0]) if len(run.trace) else NAN,
        seen=float(np.mean(seen)) if len(seen) else NAN,
        state_rms=metrics.rms(error) if len(error) else NAN,
        change_rms=metrics.rms(change) if len(change) else NAN,
    )


def _width(trace: Table, name: str) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    width: np.ndarray[tuple[int, ...], np.dtype[np.float64]] = (
        trace[f"delta_plus_{name}"] - trace[f"delta_minus_{name}"]
    )
    return width


def replay_figure(replayed: Recording, recorded: Recording | None = None) -> Figure:
    """A row per DOF: where the tip was estimated to be, and the slack learnt, over time."""
    from matplotlib.figure import Figure  # noqa: PLC0415  it takes half a second

    from tautscope.report.figures import BLUE, GREY, ORANGE, PAGE, style  # noqa: PLC0415

    runs = [(replayed, "replayed", BLUE, 0.9)]
    if recorded is not None:
        runs.insert(0, (recorded, "recorded", GREY, 1.8))
    begin = float(replayed.trace["time"][0])
    with style():
        figure = Figure(figsize=(PAGE, 5.0), layout="constrained")
        axes = figure.subplots(3, 2, sharex=True)
        for (tip, slack), dof in zip(axes, Dof, strict=True):
            scale, unit = dof.display_scale, dof.display_unit
            trace = replayed.trace
            tip.plot(
                trace["time"] - begin,
                trace[f"command_{dof.label}"] * scale,
                color=ORANGE,
                linewidth=0.6,
                label="command",
            )
            for run, name, colour, width in runs:
                seen = run.frames[run.frames[f"observable_{dof.label}"]]
                estimate = seen[f"estimate_{dof.label}"] * scale
                since = seen["captured_at"] - begin
                tip.plot(since, estimate, color=colour, linewidth=width, label=f"estimate, {name}")
                at, learnt = run.trace["time"] - begin, _width(run.trace, dof.label) * scale
                slack.plot(at, learnt, color=colour, linewidth=width, label=name)
            tip.set_title(f"{dof.label}: tip [{unit}]")
            slack.set_title(f"slack learnt [{unit}]")
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        lines, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(lines, labels, loc="outside upper center", ncols=len(lines))
    return figure


def write_replay(
    folder: str | PathLike[str], replayed: Recording, recorded: Recording | None = None
) -> None:
    """Make a folder with the files of `Recording.save` and replay.png, or nothing.

    Raises:
        OutputError: The folder holds something already, or cannot be written.
    """
    from tautscope.report.figures import style  # noqa: PLC0415

    figure = replay_figure(replayed, recorded)
    with new_folder(folder) as place, style():
        replayed.write(place)
        figure.savefig(place / "replay.png")
