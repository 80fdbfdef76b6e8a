"""``tautscope analyze``."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.commands import arguments
from tautscope.commands.printing import console, print_json
from tautscope.config import load_config

if TYPE_CHECKING:
    from tautscope.analysis.comparison import Analysis


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the verb ``analyze``."""
    analyze = arguments.add_verb(
        verbs,
        "analyze",
        _run,
        help="compare models of hysteresis on a recorded file",
        description="Compare models of hysteresis on a CSV or Parquet file with the positions of "
        "an actuator and its tip, each in any unit. Delimiter, decimal comma, comments and a line "
        "of units are recognised. Prints the RMS error of the predicted tip over the second "
        "half: with every measured tip, and with the tip seen only after each 1, 3 and 10 % of the "
        "command's range. On-line models predict each sample before they use it. Lines without a "
        "command are removed, with --time duplicate lines too; the counts are printed.",
        extras=["analysis"],
    )
    analyze.add_argument(
        "file", metavar="FILE", help="CSV with a header line, or Parquet; - reads standard input"
    )
    analyze.add_argument(
        "--command", required=True, metavar="COL", help="column of the actuator position"
    )
    analyze.add_argument(
        "--measured", required=True, metavar="COL", help="column of the tip position"
    )
    analyze.add_argument(
        "--time",
        metavar="COL",
        help="column of the time, in s or ISO 8601, for cleaning and figures",
    )
    analyze.add_argument(
        "--update-distance",
        type=arguments.above_zero,
        metavar="X",
        help="command travel between two updates of the on-line estimators, in the tip's unit "
        "[1 %% of the command's range]",
    )
    analyze.add_argument(
        "--gain",
        type=arguments.not_zero,
        metavar="G",
        help="tip travel per command travel in contact, 1 for equal units [fitted to first half]",
    )
    arguments.add_out(analyze, "analyze")
    arguments.add_config(analyze)
    arguments.add_json(analyze)


def _run(options: argparse.Namespace) -> None:
    from tautscope.analysis.comparison import analyze  # noqa: PLC0415
    from tautscope.analysis.output import write_analysis  # noqa: PLC0415
    from tautscope.analysis.suggestion import suggest_settings  # noqa: PLC0415
    from tautscope.commands.progress import progress_bar  # noqa: PLC0415
    from tautscope.runs.records import read_record  # noqa: PLC0415

    config = load_config(options.config)
    folder = arguments.out_folder(options)
    record = read_record(options.file, options.command, options.measured, options.time)
    with progress_bar("fits") as progress:
        analysis = analyze(record, config, options.update_distance, options.gain, progress=progress)
    write_analysis(analysis, folder)
    settings = suggest_settings(analysis)
    if options.json:
        suggested = None if settings is None else asdict(settings)
        print_json({"folder": str(folder), **analysis.to_json(), "settings": suggested})
        return
    _print(analysis, folder)
    if settings is not None:
        print(f"\nTo paste into a configuration:\n\n{settings.to_toml()}")


def _print(analysis: Analysis, folder: Path) -> None:
    from rich.table import Table  # noqa: PLC0415

    from tautscope.analysis.comparison import HORIZONS  # noqa: PLC0415

    table = Table(box=None, pad_edge=False, title_justify="left", title_style="bold")
    table.title = "Error of the predicted tip, RMS over the second half [tip's unit]"
    table.add_column("model", no_wrap=True)
    table.add_column("fitted to", no_wrap=True)
    horizons = [f"{100 * share:.0f} %" for share in HORIZONS]
    for heading in ("every tip", *horizons, "gain", "width"):
        table.add_column(heading, justify="right", no_wrap=True)
    for entry in analysis.entries:
        parameters = entry.prediction.parameters
        table.add_row(
            entry.model.title,
            entry.model.fitted_to,
            f"{entry.rmse:.4g}",
            *(f"{error.rmse:.4g}" for error in entry.horizons),
            *(
                f"{parameters[name]:.4g}" if name in parameters else ""
                for name in ("gain", "width")
            ),
        )
    screen = console()
    screen.print(table)
    screen.print(
        "\nevery tip: models fitted off-line get the command alone. 1 % ...: the tip is seen only "
        "after this share of the command's range; off-line models continue from the last tip seen.",
        soft_wrap=True,
    )
    screen.print(_cleaning(analysis), soft_wrap=True)
    screen.print(f"Figure and samples: {folder / 'analyze.png'}", soft_wrap=True)


def _cleaning(analysis: Analysis) -> str:
    record = analysis.record
    cleaning = record.cleaning
    counts = {
        "lines without a command, removed": cleaning.blank,
        "lines without a tip, kept but not scored": cleaning.unseen,
        "duplicate lines, removed": cleaning.duplicates,
        "late lines, sorted by time": cleaning.reordered,
        "clock set back, later times shifted": cleaning.clock_steps,
        f"gaps in time, the longest {cleaning.longest_gap:.3g} s": cleaning.gaps,
    }
    notes = [f"{what}: {number}" for what, number in counts.items() if number]
    scored = f"{len(record.rows)} samples, {analysis.scored.sum()} of them scored"
    if record.time is None:
        notes.append("order and duplicates not checked without --time")
    return "; ".join([scored, *notes]) + "."
