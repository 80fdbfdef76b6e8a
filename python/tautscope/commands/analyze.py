"""``tautscope analyze``."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

from tautscope.commands import arguments
from tautscope.commands.analyze_episodes import analyze_episodes
from tautscope.commands.analyze_output import print_columns, print_results, results_to_json
from tautscope.commands.printing import print_json, progress_bar
from tautscope.config import load_config
from tautscope.errors import FieldError, RecordError
from tautscope.runs.columns import list_columns, time_column
from tautscope.runs.episodes import Episode, is_data_set, list_episodes, open_episode
from tautscope.runs.records import read_record
from tautscope.runs.tables import Sheet, open_table
from tautscope.runs.units import split_unit

if TYPE_CHECKING:
    from tautscope.analysis.comparison import Analysis
    from tautscope.analysis.verdict import Verdict


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the verb ``analyze``."""
    analyze = arguments.add_verb(
        verbs,
        "analyze",
        _run,
        help="slack of a recorded file, and what compensation would do",
        description="Say what slack a table with the positions of actuators and "
        "their tips has, each in any unit, how sure that is, what compensation would do, what is "
        "wrong with the record and what to do next. Delimiter, decimal comma, comments and a line "
        "of units are recognised. Writes the configuration of a loop for what was identified, and "
        "a program that runs it. Then compares models of hysteresis by the RMS error of the "
        "predicted tip over the second half: with every measured tip, and with the tip seen only "
        "after each 1, 3 and 10 % of the command's range. On-line models predict each sample "
        "before they use it. With a time, the command is interpolated at the tip's times, and "
        "duplicate lines are removed; the counts are printed.",
        extras=["analysis"],
    )
    analyze.add_argument(
        "file",
        metavar="FILE",
        help="CSV, Parquet, .npz, .mat, ROS 2 bag, or folder of a LeRobot data set; - reads "
        "standard input",
    )
    analyze.add_argument(
        "--command",
        nargs="+",
        metavar="COL",
        help="columns of the actuators' positions, one per degree of freedom, by title or number; "
        "without it the columns are listed, and pairs proposed",
    )
    analyze.add_argument(
        "--measured",
        nargs="+",
        metavar="COL",
        help="columns of the tips' positions in the same order, by title or number",
    )
    analyze.add_argument(
        "--time",
        metavar="COL",
        help="column of the time: in the unit of its title, without one in s, or since 1970 by its "
        "size; or dates and times of day [a column titled time, t, stamp or timestamp]",
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
        help="exit status 1 if the compensator would not help in each degree of freedom",
    )
    analyze.add_argument(
        "--episode",
        type=arguments.natural,
        metavar="N",
        help="one episode of a data set, in full [the slack of all episodes]",
    )
    analyze.add_argument(
        "--workers",
        type=arguments.positive,
        metavar="N",
        help="processes for the episodes of a data set [all cores]",
    )
    arguments.add_out(analyze, "analyze")
    arguments.add_config(analyze)
    arguments.add_json(analyze)


def _run(options: argparse.Namespace) -> int:
    from tautscope.analysis.output import write_results  # noqa: PLC0415

    if options.command is None and options.measured is None:
        of_columns = ("time", "tip_file", "missing", "update_distance", "gain", "check", "workers")
        needed = "--command and --measured: without them the columns are listed"
        arguments.refuse_unused(options, needed, *of_columns, "out", "config")
        _, sheet = _open(options)
        columns, pairs, left_out = list_columns(sheet)
        proposed = [{"command": command, "measured": tip} for command, tip in pairs]
        document = {"columns": [asdict(column) for column in columns], "pairs": proposed}
        print_json(options, document | {"left_out": [str(error) for error in left_out]})
        print_columns(options.file, columns, pairs, left_out)
        return 0
    for name in ("command", "measured"):
        if getattr(options, name) is None:
            options.usage_error(f"the following arguments are required: --{name}")
    if len(options.command) != len(options.measured):
        options.usage_error(
            f"--command has {len(options.command)} columns, --measured {len(options.measured)}: "
            "one tip per actuator"
        )
    episodes, sheet = _open(options)
    commands = [sheet.index(each) for each in options.command]
    for name, chosen in (("command", commands), ("measured", options.measured)):
        if len(set(chosen)) < len(chosen):
            options.usage_error(f"--{name} has a column twice: each degree of freedom has its own")
    if episodes and options.episode is None:
        names = _names([sheet.titles[sheet.index(tip)] for tip in options.measured])
        analyze_episodes(options, episodes, names)
        return 0
    arguments.refuse_unused(options, "no --episode", "workers")
    folder = arguments.out_folder(options)
    results = _results(options, sheet)
    settings = write_results(results, folder)
    print_json(options, {"folder": str(folder), **results_to_json(results, settings)})
    print_results(results, folder)
    helps = all(verdict.helps for verdict, _ in results)
    return 0 if helps or not options.check else 1


def _open(options: argparse.Namespace) -> tuple[list[Episode], Sheet]:
    """The episodes of a data set, and the table of the first or the chosen one; or a table."""
    if not is_data_set(options.file):
        for name in ("episode", "workers"):
            if getattr(options, name) is not None:
                options.usage_error(f"--{name} is for the folder of a data set")
        return [], open_table(options.file)
    episodes = list_episodes(options.file)
    chosen = [each for each in episodes if options.episode in (None, each.number)]
    if not chosen:
        allowed = f"one of {episodes[0].number} to {episodes[-1].number}"
        raise FieldError("--episode", options.episode, allowed)
    return episodes, open_episode(options.file, chosen[0])


def _results(options: argparse.Namespace, sheet: Sheet) -> list[tuple[Verdict, Analysis]]:
    """Verdict and comparison of models per degree of freedom; the file is read once."""
    from tautscope.analysis.comparison import analyze  # noqa: PLC0415
    from tautscope.analysis.verdict import judge, together  # noqa: PLC0415

    config = load_config(options.config)
    other = None if options.tip_file is None else open_table(options.tip_file)
    tips = sheet if other is None else other
    time = options.time or time_column(sheet.titles)
    pairs = list(zip(options.command, options.measured, strict=True))
    names = _names([tips.titles[tips.index(tip)] for _, tip in pairs])
    results = []
    with progress_bar("fits") as progress:
        for index, (command, tip) in enumerate(pairs):

            def report(share: float, done: int = index) -> None:
                progress((done + share) / len(pairs))

            try:
                record = read_record(
                    sheet, command, tip, time, tip_path=other, missing=options.missing
                )
                verdict = judge(record, names[index], (command, tip))
            except RecordError as error:
                if len(pairs) > 1:
                    error.add_note(f"of command {command} and measured {tip}")
                raise
            distance, gain = options.update_distance, options.gain
            analysis = analyze(verdict.record, config, distance, gain, progress=report)
            results.append((verdict, analysis))
    verdicts = together([verdict for verdict, _ in results])
    return [(verdict, analysis) for verdict, (_, analysis) in zip(verdicts, results, strict=True)]


def _names(titles: Sequence[str]) -> list[str]:
    """Names of degrees of freedom after the titles of their tips, or axis_1, axis_2, ..."""
    plain = [split_unit(title)[0].lower() for title in titles]
    names = [re.sub(r"[^a-z0-9]+", "_", each).strip("_")[:32] for each in plain]
    is_usable = len(set(names)) == len(names) and all(re.match("[a-z]", each) for each in names)
    return names if is_usable else [f"axis_{index + 1}" for index in range(len(names))]
