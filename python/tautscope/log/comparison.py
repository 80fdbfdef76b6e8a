"""Comparison of the estimates of a replay with those of the run: numbers per DOF, and a figure."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tautscope.report import metrics
from tautscope.runs.output_folder import new_folder
from tautscope.runs.recording import Recording, Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST_SEEN = 10
"""Updates in which a DOF was observable, below which its backlash is unknown."""


def estimation_quality(
    run: Recording, other: Recording | None = None
) -> dict[str, dict[str, float]]:
    """Quality of the estimates by DOF [m or rad]; NaN where unknown.

    Returns:
        Of each DOF ``width``, the backlash width delta_plus - delta_minus at the end, NaN if the
        motor travelled less than that, or fewer than `LEAST_SEEN` updates showed the DOF; ``seen``,
        the share of the updates in which the DOF was observable; ``state_rms``, the RMS error of
        the estimate over these, if the true state is known; and ``change_rms``, its RMS difference
        from another run on the same inputs, over the updates that showed the DOF in both.
    """
    return {dof.label: _quality(run, other, dof.label) for dof in run.config.dofs}


def _quality(run: Recording, other: Recording | None, name: str) -> dict[str, float]:
    estimate, observable = f"estimate_{name}", f"observable_{name}"
    frames, seen = run.frames, run.frames[observable]
    error = (frames[estimate] - frames[f"true_{name}"])[seen]
    change = np.empty(0)
    if other is not None:
        _, mine, theirs = np.intersect1d(
            frames["sequence"], other.frames["sequence"], return_indices=True
        )
        both = seen[mine] & other.frames[observable][theirs]
        change = (frames[estimate][mine] - other.frames[estimate][theirs])[both]
    width = float(_width(run.trace[-1:], name)[0]) if len(run.trace) else np.nan
    # No travel shows slack wider than itself; 0 is the estimate before any.
    is_known = (
        0 < width <= float(np.ptp(run.trace[f"command_{name}"]))
        and np.count_nonzero(seen) >= LEAST_SEEN
    )
    return {
        "width": width if is_known else np.nan,
        "seen": float(np.mean(seen)) if len(seen) else np.nan,
        "state_rms": metrics.rms(error),
        "change_rms": metrics.rms(change),
    }


def _width(trace: Table, name: str) -> NDArray[np.float64]:
    return np.asarray(trace[f"delta_plus_{name}"] - trace[f"delta_minus_{name}"], np.float64)


def replay_figure(replayed: Recording, recorded: Recording | None = None) -> Figure:
    """Plot state estimate and backlash width of each DOF over time."""
    from matplotlib.figure import Figure  # noqa: PLC0415  slow import

    from tautscope.figure_style import BLUE, GREY, ORANGE, PAGE, style  # noqa: PLC0415

    runs = [(replayed, "replayed", BLUE, 0.9)]
    if recorded is not None:
        runs.insert(0, (recorded, "recorded", GREY, 1.8))
    start = float(replayed.trace["time"][0])
    with style():
        dofs = replayed.config.dofs
        figure = Figure(figsize=(PAGE, 1.5 * len(dofs) + 0.5), layout="constrained")
        axes = figure.subplots(len(dofs), 2, sharex=True, squeeze=False)
        for (state_axis, width_axis), dof in zip(axes, dofs, strict=True):
            scale, unit = dof.display_scale, dof.display_unit
            times = replayed.trace["time"] - start
            command = replayed.trace[f"command_{dof.label}"] * scale
            state_axis.plot(times, command, color=ORANGE, linewidth=0.6, label="command")
            for run, name, colour, width in runs:
                seen = run.frames[run.frames[f"observable_{dof.label}"]]
                estimate = seen[f"estimate_{dof.label}"] * scale
                times = seen["captured_at"] - start
                label = f"estimate, {name}"
                state_axis.plot(times, estimate, color=colour, linewidth=width, label=label)
                times, backlash = run.trace["time"] - start, _width(run.trace, dof.label) * scale
                width_axis.plot(times, backlash, color=colour, linewidth=width, label=name)
            state_axis.set_title(f"{dof.label}: tip [{unit}]")
            width_axis.set_title(f"estimated backlash width [{unit}]")
        for axis in axes[-1]:
            axis.set_xlabel("time [s]")
        lines, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(lines, labels, loc="outside upper center", ncols=len(lines))
    return figure


def write_replay(
    folder: str | PathLike[str], replayed: Recording, recorded: Recording | None = None
) -> None:
    """Write a new folder with the files of `Recording.save` and replay.png.

    Raises:
        OutputError: The folder is not empty, or cannot be written; then nothing is written.
    """
    from tautscope.figure_style import style  # noqa: PLC0415

    figure = replay_figure(replayed, recorded)
    with new_folder(folder) as folder_path, style():
        replayed.write(folder_path)
        figure.savefig(folder_path / "replay.png")
