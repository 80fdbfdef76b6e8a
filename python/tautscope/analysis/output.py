"""The files of an analysis: compensator, samples as CSV, and figures."""

from collections.abc import Sequence
from os import PathLike
from typing import Any

import numpy as np
import polars as pl
from matplotlib.figure import Figure, SubFigure
from numpy.typing import NDArray

from tautscope.analysis.comparison import HORIZONS, Analysis
from tautscope.analysis.compensator import write_compensator
from tautscope.analysis.models.registry import LINEAR_FIT
from tautscope.analysis.models.task import Floats
from tautscope.analysis.slide import slide, thinned
from tautscope.analysis.verdict import Verdict, parts_of
from tautscope.figure_style import BLUE, GREY, PAGE, style
from tautscope.runs.output_folder import new_folder


def write_results(
    results: Sequence[tuple[Verdict, Analysis]], folder: str | PathLike[str]
) -> dict[str, Any] | None:
    """Make a folder with the files of all degrees of freedom, complete or not at all.

    analyze.png has the verdict, models.png the comparison, analysis.csv the samples; of several
    degrees of freedom each has a folder of its name. compensator.toml and compensator.py are for
    those whose slack is identified; without one they are not written.

    Returns:
        The configuration in compensator.toml, or None.

    Raises:
        OutputError: The folder is not empty, or cannot be written.
    """
    with new_folder(folder) as place:
        for verdict, analysis in results:
            own = place if len(results) == 1 else place / verdict.name
            own.mkdir(exist_ok=True)
            columns = {name: _rounded(values) for name, values in _columns(analysis).items()}
            table = pl.DataFrame(columns).fill_nan(None)
            table.write_csv(own / "analysis.csv", null_value="nan")
            with style():
                slide(verdict).savefig(own / "analyze.png")
                analysis_figure(analysis).savefig(own / "models.png")
        parts = parts_of(verdict for verdict, _ in results)
        return write_compensator(parts, place) if parts else None


def _rounded(values: Floats | NDArray[np.int64]) -> Floats | NDArray[np.int64]:
    """Numbers of nine significant digits, and integers."""
    if values.dtype.kind == "i":
        return values
    with np.errstate(divide="ignore"):
        places = 8 - np.floor(np.log10(np.abs(values)))
    scale = 10 ** np.clip(places, 0, 300)
    return np.asarray(np.round(values * scale) / scale)


def _columns(analysis: Analysis) -> dict[str, Floats | NDArray[np.int64]]:
    """Line of the file, time if it was read, signals, then predictions and traces of each model."""
    record = analysis.record
    columns: dict[str, Floats | NDArray[np.int64]] = {"line": record.rows}
    if record.time is not None:
        columns["time"] = record.time
    columns |= {"command": record.command, "measured": record.measured}
    for entry in analysis.entries:
        columns[entry.model.name] = entry.prediction.tip
        for name, trace in entry.prediction.traces.items():
            columns[f"{entry.model.name}_{name}"] = trace
    return columns


def analysis_figure(analysis: Analysis) -> Figure:
    """Errors over the horizons; below, a row per model: error over the record, and loop."""
    with style():
        rows = 1.15 * len(analysis.entries) + 0.5
        figure = Figure(figsize=(PAGE, rows + 2.6), layout="constrained")
        parts = figure.subfigures(2, 1, squeeze=False, height_ratios=(2.6, rows))
        _draw_horizons(parts[0, 0], analysis)
        _draw_models(parts[1, 0], analysis)
    return figure


def _draw_horizons(figure: SubFigure, analysis: Analysis) -> None:
    """RMS error of each model over the distance of the sights."""
    axes = figure.subplots()
    shares = 100 * np.array(HORIZONS)
    for number, entry in enumerate(analysis.entries):
        is_best = entry.model.name == "best"
        axes.loglog(
            shares,
            [error.rmse for error in entry.horizons],
            marker="osv^D<>Px"[number % 9],
            markersize=4,
            color=BLUE if is_best else f"C{number % 9 + 1}",
            linewidth=2 if is_best else 0.8,
            label=entry.model.title,
        )
    axes.set_xticks(shares, [f"{share:.0f} %" for share in shares], minor=False)
    axes.minorticks_off()
    axes.set_xlabel("travel of the command between observed tips, share of its range")
    axes.set_ylabel("RMS error")
    axes.set_title("RMS over the second half; tip observed after each travel of the command")
    figure.legend(loc="outside right upper")


def _draw_models(figure: SubFigure, analysis: Analysis) -> None:
    """A row per model: its error with every tip over the record, and its loop over the measured.

    The horizontal axis is the record's time if it was read, else the sample number. Loops are of
    the second half. All errors have one scale, set by their 99th percentiles; only the linear fit,
    whose error is usually far larger, has its own.
    """
    record = analysis.record
    at = np.arange(len(record.rows)) if record.time is None else record.time
    measured = np.isfinite(record.measured)
    errors = [entry.prediction.tip - record.measured for entry in analysis.entries]
    scored = analysis.scored
    limits = [1.1 * float(np.quantile(np.abs(error[scored]), 0.99)) for error in errors]
    is_linear = [entry.model is LINEAR_FIT for entry in analysis.entries]
    others = [limit for limit, own in zip(limits, is_linear, strict=True) if not own]
    common = max(others, default=0.0)
    count = len(analysis.entries)
    axes = figure.subplots(count, 2, sharex="col", squeeze=False, width_ratios=(3.2, 1))
    for row, entry in enumerate(analysis.entries):
        strip, loop = axes[row]
        strip.axvspan(at[0], at[analysis.half], color="#f0f0f0", linewidth=0)
        strip.axhline(0, color=GREY, linewidth=0.5)
        strip.plot(*thinned(at[measured], errors[row][measured]), color=BLUE, linewidth=0.7)
        if not np.isfinite(errors[row][: analysis.half]).any():
            middle = (at[0] + at[analysis.half]) / 2
            strip.text(middle, 0, "calibration: no prediction", ha="center", va="bottom")
        strip.set_title(f"{entry.model.title}: {entry.rmse:.3g}")
        strip.set_ylabel("error")
        limit = limits[row] if is_linear[row] else common
        if limit > 0:
            strip.set_ylim(-limit, limit)
        command = record.command[scored]
        loop.plot(command, record.measured[scored], color=GREY, linewidth=1.6)
        loop.plot(command, entry.prediction.tip[scored], color=BLUE, linewidth=0.7)
        loop.set_ylabel("tip")
        loop.locator_params(axis="x", nbins=3)
    axes[0, 0].set_xlim(at[0], at[-1])
    axes[-1, 0].set_xlabel("sample" if record.time is None else "time [s]")
    axes[-1, 1].set_xlabel("command")
    axes[0, 0].set_title("RMS over the second half (white)", loc="right", fontweight="normal")
    axes[0, 1].set_title("measured", color=GREY, loc="left")
    axes[0, 1].set_title("model", color=BLUE, loc="right", fontweight="bold")


def episodes_figure(rows: Sequence[dict[str, Any]], names: Sequence[str]) -> Figure:
    """Width with its interval in each episode, one panel per degree of freedom."""
    with style():
        figure = Figure(figsize=(PAGE, 0.6 + 1.6 * len(names)), layout="constrained")
        panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(panels, names, strict=True):
            own = [row for row in rows if row["name"] == name]
            known = [row for row in own if row["identified"]]
            at, width, low, high = (
                np.array([row[key] for row in known], np.float64)
                for key in ("episode", "width", "width_low", "width_high")
            )
            axes.vlines(at, low, high, color=BLUE, linewidth=0.8, alpha=0.5)
            axes.plot(at, width, "o", color=BLUE, markersize=2.5)
            if known:
                axes.axhline(float(np.median(width)), color=GREY, linewidth=0.8, zorder=0)
            axes.margins(y=0.15)
            axes.set_ylim(bottom=0)
            axes.set_ylabel("slack")
            median = f", median {np.median(width):.3g}" if known else ""
            axes.set_title(f"{name}: identified in {len(known)} of {len(own)} episodes{median}")
        panels[-1].set_xlabel("episode")
    return figure
