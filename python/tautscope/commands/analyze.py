"""``tautscope analyze``."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.commands import arguments
from tautscope.commands.printing import console, print_json
from tautscope.config import load_config

if TYPE_CHECKING:
    from tautscope.analysis.records import Analysis


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the verb to the command's."""
    analyze = verbs.add_parser(
        "analyze",
        allow_abbrev=False,
        help="compare models of hysteresis on a recorded file",
        description="Compare models of hysteresis on a CSV file of an actuator's and its tip's "
        "position, each in any unit: RMS error of the predicted tip over the second half. The "
        "estimators that learn on-line predict each sample before they see it. Lines without a "
        "command are left out, and with --time duplicates too; all is counted and said.",
    )
    analyze.add_argument("file", type=Path, metavar="FILE.csv", help="CSV with a header line")
    analyze.add_argument("--command", required=True, metavar="COL", help="column: actuator")
    analyze.add_argument("--measured", required=True, metavar="COL", help="column: tip")
    analyze.add_argument("--time", metavar="COL", help="column: time, to clean and draw by")
    analyze.add_argument(
        "--update-distance",
        type=arguments.above_zero,
        metavar="X",
        help="command travel between two updates of the on-line estimators, the tip's unit "
        "[1 %% of the command's range]",
    )
    analyze.add_argument(
        "--gain",
        type=arguments.not_zero,
        metavar="G",
        help="tip travel per command travel in contact, 1 for one unit [learnt from first half]",
    )
    arguments.add_out(analyze, "analyze")
    arguments.add_config(analyze)
    arguments.add_json(analyze)
    analyze.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> None:
    from tautscope.analysis.output import write_analysis  # noqa: PLC0415
    from tautscope.analysis.records import analyze  # noqa: PLC0415
    from tautscope.runs.output_folder import check_free, default_folder  # noqa: PLC0415
    from tautscope.runs.replay import read_record  # noqa: PLC0415

    config = load_config(options.config)
    folder = check_free(options.out or default_folder("analyze"))
    record = read_record(options.file, options.command, options.measured, options.time)
    found = analyze(record, config, options.update_distance, options.gain)
    write_analysis(found, folder)
    if options.json:
        print_json(found.to_json())
    else:
        _print(found, folder)


def _print(found: Analysis, folder: Path) -> None:
    from rich.table import Table  # noqa: PLC0415

    table = Table(box=None, pad_edge=False, title_justify="left", title_style="bold")
    table.title = "Error of the predicted tip, RMS over the second half [tip's unit]"
    table.add_column("model", no_wrap=True)
    table.add_column("learns from", no_wrap=True)
    for heading in ("RMS", "of no model", "gain", "width"):
        table.add_column(heading, justify="right", no_wrap=True)
    for entry in found.entries:
        known = entry.prediction.parameters
        share = found.share(entry)
        table.add_row(
            entry.model.title,
            entry.model.learns,
            f"{entry.rmse:.4g}",
            "" if math.isnan(share) else f"{100 * share:.1f} %",
            *(f"{known[name]:.4g}" if name in known else "" for name in ("gain", "width")),
        )
    screen = console()
    screen.print(table)
    screen.print(f"\n{_cleaning(found)}", soft_wrap=True)
    screen.print(f"Figure and samples: {folder / 'analyze.png'}", soft_wrap=True)


def _cleaning(found: Analysis) -> str:
    record = found.record
    done = record.cleaning
    counts = {
        "lines without a command, left out": done.blank,
        "lines without a tip, kept but not scored": done.unseen,
        "duplicate lines, left out": done.duplicates,
        "late lines, put in order": done.reordered,
        "clock set back, later times shifted": done.clock_steps,
        f"gaps in time, the longest {done.longest_gap:.3g} s": done.gaps,
    }
    said = [f"{what}: {number}" for what, number in counts.items() if number]
    scored = f"{len(record.rows)} samples, {found.scored.sum()} of them scored"
    if record.time is None:
        said.append("order and duplicates not checked without --time")
    return "; ".join([scored, *said]) + "."
