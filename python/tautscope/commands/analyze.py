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
        help="slack of a recorded file, and what compensation would do",
        description="Say what slack a CSV or Parquet file with the positions of an actuator and "
        "its tip has, each in any unit, how sure that is, what compensation would do, what is "
        "wrong with the record and what to do next. Delimiter, decimal comma, comments and a line "
        "of units are recognised. Then compares models of hysteresis by the RMS error of the "
        "predicted tip over the second half: with every measured tip, and with the tip seen only "
        "after each 1, 3 and 10 % of the command's range. On-line models predict each sample "
        "before they use it. With a time, the command is interpolated at the tip's times, and "
        "duplicate lines are removed; the counts are printed.",
        extras=["analysis"],
    )
    analyze.add_argument(
        "file", metavar="FILE", help="CSV with a header line, or Parquet; - reads standard input"
    )
    analyze.add_argument(
        "--command",
        metavar="COL",
        help="column of the actuator position, by title or number; without it the columns are "
        "listed, and pairs proposed",
    )
    analyze.add_argument(
        "--measured", metavar="COL", help="column of the tip position, by title or number"
    )
    analyze.add_argument(
        "--time",
        metavar="COL",
        help="column of the time: in s or the unit of its title, since 1970 by its size, or dates "
        "and times of day [a column titled time, t, stamp or timestamp]",
    )
    analyze.add_argument(
        "--tip-file",
        metavar="FILE",
        help="file of the tip, if it is not in the first; both have the time of one clock",
    )
    analyze.add_argument(
        "--missing",
        action="append",
        type=float,
        default=[],
        metavar="X",
        help="value that stands for none, such as -9999; may be repeated",
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
    analyze.add_argument(
        "--check",
        action="store_true",
        help="exit status 1 if the compensator would not help",
    )
    arguments.add_out(analyze, "analyze")
    arguments.add_config(analyze)
    arguments.add_json(analyze)


def _run(options: argparse.Namespace) -> int:
    from tautscope.analysis.comparison import analyze  # noqa: PLC0415
    from tautscope.analysis.output import write_analysis  # noqa: PLC0415
    from tautscope.analysis.verdict import judge  # noqa: PLC0415
    from tautscope.commands.progress import progress_bar  # noqa: PLC0415
    from tautscope.runs.columns import time_column  # noqa: PLC0415
    from tautscope.runs.records import read_record  # noqa: PLC0415
    from tautscope.runs.tables import STDIN, open_table  # noqa: PLC0415

    if options.command is None and options.measured is None:
        return _list(options)
    for name in ("command", "measured"):
        if getattr(options, name) is None:
            options.usage_error(f"the following arguments are required: --{name}")
    config = load_config(options.config)
    folder = arguments.out_folder(options)
    time = options.time
    if time is None and options.file != STDIN:
        time = time_column(open_table(options.file).titles)
    record = read_record(
        options.file,
        options.command,
        options.measured,
        time,
        tip_path=options.tip_file,
        missing=options.missing,
    )
    verdict = judge(record)
    with progress_bar("fits") as progress:
        analysis = analyze(
            verdict.record, config, options.update_distance, options.gain, progress=progress
        )
    write_analysis(analysis, folder)
    if options.json:
        entry = verdict.to_json()
        pair = {"command": options.command, "measured": options.measured}
        print_json(
            {
                "folder": str(folder),
                "verdict": verdict.text,
                "dofs": [pair | entry],
                **analysis.to_json(),
                "settings": entry["settings"],
            }
        )
    else:
        console().print(verdict.text, soft_wrap=True)
        print()
        _print(analysis, folder, is_identified=verdict.found.is_identified)
        if verdict.settings is not None:
            print(f"\nTo paste into a configuration:\n\n{verdict.settings.to_toml()}")
    return 0 if verdict.helps or not options.check else 1


def _list(options: argparse.Namespace) -> int:
    """Print the columns with their ranges, and commands to continue with."""
    import shlex  # noqa: PLC0415

    from rich.table import Table  # noqa: PLC0415

    from tautscope.runs.columns import list_columns  # noqa: PLC0415
    from tautscope.runs.tables import open_table  # noqa: PLC0415

    columns, pairs = list_columns(open_table(options.file))
    if options.json:
        proposed = [{"command": command, "measured": tip} for command, tip in pairs]
        print_json({"columns": [asdict(column) for column in columns], "pairs": proposed})
        return 0
    table = Table(box=None, pad_edge=False)
    for heading in ("number", "title", "unit", "values", "least", "largest"):
        table.add_column(heading, justify="left" if heading in ("title", "unit") else "right")
    for each in columns:
        limits = f"{each.least:.6g}", f"{each.largest:.6g}"
        table.add_row(str(each.number), each.title, each.unit, str(each.count), *limits)
    screen = console()
    screen.print(table)
    print("\nType one of these:" if pairs else "\nNo two columns move together.")
    for command, tip in pairs:
        words = ["tautscope", "analyze", options.file, "--command", command, "--measured", tip]
        screen.print(f"  {shlex.join(words)}", soft_wrap=True)
    return 0


def _print(analysis: Analysis, folder: Path, *, is_identified: bool) -> None:
    from rich.table import Table  # noqa: PLC0415

    from tautscope.analysis.comparison import HORIZONS  # noqa: PLC0415

    table = Table(box=None, pad_edge=False, title_justify="left", title_style="bold")
    table.title = "Error of the predicted tip, RMS over the second half [tip's unit]"
    table.add_column("model", no_wrap=True)
    table.add_column("fitted to", no_wrap=True)
    horizons = [f"{100 * share:.0f} %" for share in HORIZONS]
    shown = ("gain", "width") if is_identified else ("gain",)
    for heading in ("every tip", *horizons, *shown):
        table.add_column(heading, justify="right", no_wrap=True)
    for entry in analysis.entries:
        parameters = entry.prediction.parameters
        table.add_row(
            entry.model.title,
            entry.model.fitted_to,
            f"{entry.rmse:.4g}",
            *(f"{error.rmse:.4g}" for error in entry.horizons),
            *(f"{parameters[name]:.4g}" if name in parameters else "" for name in shown),
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
        "lines without a command or time, removed": cleaning.blank,
        "commands interpolated at the tip's times": cleaning.interpolated,
        "lines without a tip, kept but not scored": cleaning.unseen,
        "duplicate lines, removed": cleaning.duplicates,
        "late lines, sorted by time": cleaning.reordered,
        "clock set back, later times shifted": cleaning.clock_steps,
        f"gaps in time, the longest {cleaning.longest_gap:.3g} s": cleaning.gaps,
    }
    notes = [f"{what}: {number}" for what, number in counts.items() if number]
    scored = f"{len(record.rows)} samples, {analysis.scored.sum()} of them scored"
    if record.time is None:
        notes.append("delay in samples; order and duplicates not checked without --time")
    return "; ".join([scored, *notes]) + "."
