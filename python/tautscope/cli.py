"""The ``tautscope`` command."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from tautscope._core import __version__
from tautscope.config import DISTURBANCES, Config, Profile, dump_config, load_config
from tautscope.errors import MissingPathError, TautscopeError
from tautscope.hardware import commands as hardware_commands
from tautscope.hardware.doctor import commands as doctor
from tautscope.log import commands

if TYPE_CHECKING:
    from rich.console import Console

    from tautscope.analysis import Analysis
    from tautscope.demo import Demo

PROFILES = get_args(Profile)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 on success, 2 on an error a person can mend, 130 when interrupted.

    `replay` returns 1 if the outputs were others than those recorded, `doctor` if something is
    missing.
    """
    options = _parser().parse_args(arguments)
    try:
        return options.run(options) or 0
    except TautscopeError as error:
        print("\n".join([f"error: {error}", *getattr(error, "__notes__", ())]), file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted; nothing was written", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="tautscope",
        description="Takes the slack out of robotic flexible endoscopic instruments, using the "
        "endoscope's own images. Research software, not a medical device.",
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"tautscope {__version__}")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")

    demo = verbs.add_parser(
        "demo",
        allow_abbrev=False,
        help="run the article's experiment on the simulated instrument",
        description="Run the article's experiment on the simulated instrument, with and without "
        "compensation, camera images the only feedback. Prints Table 1, the article beside ours, "
        "and writes a run folder with tables, traces, figures and a report.",
    )
    demo.add_argument(
        "--profile",
        choices=PROFILES,
        default="best",
        help="how slack is compensated: as in the article, or ours beside it [%(default)s]",
    )
    demo.add_argument(
        "--seed", type=_natural, metavar="N", help="first seed [twin.seed of the configuration]"
    )
    demo.add_argument(
        "--seeds", type=_positive, default=1, metavar="N", help="number of seeds [%(default)s]"
    )
    demo.add_argument(
        "--background", metavar="DIR", help="folder of images to use as tissue [procedural mucosa]"
    )
    demo.add_argument(
        "--disturb",
        metavar="NAME[,NAME]",
        help=f"disturb the pictures: {', '.join(DISTURBANCES)} [twin.disturb of the configuration]",
    )
    demo.add_argument(
        "--out", type=Path, metavar="DIR", help="run folder, new or empty [runs/<date-time>-demo]"
    )
    _add_common(demo)
    demo.set_defaults(run=_demo)

    config = verbs.add_parser(
        "config",
        allow_abbrev=False,
        help="print the configuration",
        description="Print the configuration as TOML, every default written out.",
    )
    config.add_argument("--config", metavar="FILE", help="TOML file; what it leaves out is default")
    config.set_defaults(run=_config)

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
        type=_distance,
        metavar="X",
        help="command travel between two updates of the on-line estimators, the tip's unit "
        "[1 %% of the command's range]",
    )
    analyze.add_argument(
        "--gain",
        type=_gain,
        metavar="G",
        help="tip travel per command travel in contact, 1 for one unit [learnt from first half]",
    )
    analyze.add_argument(
        "--out", type=Path, metavar="DIR", help="folder, new or empty [runs/<date-time>-analyze]"
    )
    _add_common(analyze)
    analyze.set_defaults(run=_analyze)
    commands.add_parsers(verbs)
    hardware_commands.add_parsers(verbs)
    doctor.add_parser(verbs)
    return parser


def _add_common(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--config", metavar="FILE", help="TOML file; what it leaves out is default")
    parser.add_argument("--json", action="store_true", help="print one JSON object and no more")


def _natural(text: str) -> int:
    return _integer(text, 0)


def _positive(text: str) -> int:
    return _integer(text, 1)


def _integer(text: str, least: int) -> int:
    if not text.isdecimal() or int(text) < least:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected an integer of at least {least}")
    return int(text)


def _distance(text: str) -> float:
    value = _number(text)
    if not value > 0:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a number above 0")
    return value


def _gain(text: str) -> float:
    value = _number(text)
    if math.isnan(value) or value == 0:
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a number other than 0")
    return value


def _number(text: str) -> float:
    """The finite number in a text, or NaN."""
    try:
        value = float(text)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def _config(options: argparse.Namespace) -> None:
    print(dump_config(load_config(options.config)), end="")


def _demo(options: argparse.Namespace) -> None:
    from tautscope import demo, tables  # noqa: PLC0415
    from tautscope.output import check_free  # noqa: PLC0415
    from tautscope.progress import progress_bar  # noqa: PLC0415

    config = _demo_config(options)
    folder = check_free(options.out or demo.default_folder("demo"))
    first = config.twin.seed
    seeds = range(first, first + options.seeds)
    each = 2 if config.profile == "paper" else 3
    with progress_bar(f"{each * len(seeds)} runs") as progress:
        found = demo.run_demo(config, seeds, progress)
    demo.write_run_folder(found, folder)
    if options.json:
        _print_json(
            tables.to_json(
                options.profile,
                seeds,
                found.results,
                found.sim_seconds,
                found.wall_seconds,
                article_results=found.article_results,
            )
        )
    else:
        _print_table1(found, folder)


def _demo_config(options: argparse.Namespace) -> Config:
    config = load_config(options.config, options.profile)
    changes: dict[str, Any] = {}
    if options.seed is not None:
        changes["twin.seed"] = options.seed
    if options.background is not None:
        changes["twin.background"] = options.background
    if options.disturb is not None:
        changes["twin.disturb"] = [name.strip() for name in options.disturb.split(",")]
    config = config.replace(**changes)
    background = config.twin.background
    if background is not None and not Path(background).is_dir():
        raise MissingPathError("twin.background", background, "a folder of images")
    return config


def _analyze(options: argparse.Namespace) -> None:
    from tautscope import analysis  # noqa: PLC0415
    from tautscope.demo import default_folder  # noqa: PLC0415
    from tautscope.output import check_free  # noqa: PLC0415
    from tautscope.replay import read_record  # noqa: PLC0415

    config = load_config(options.config)
    folder = check_free(options.out or default_folder("analyze"))
    record = read_record(options.file, options.command, options.measured, options.time)
    found = analysis.analyze(record, config, options.update_distance, options.gain)
    analysis.write_analysis(found, folder)
    if options.json:
        _print_json(found.to_json())
    else:
        _print_analysis(found, folder)


def _print_json(document: dict[str, Any]) -> None:
    print(json.dumps(document, allow_nan=False))


def _console() -> Console:
    from rich.console import Console  # noqa: PLC0415

    width = None if sys.stdout.isatty() else 200
    return Console(highlight=False, markup=False, width=width)


def _print_table1(demo: Demo, folder: Path) -> None:
    from rich.table import Table  # noqa: PLC0415

    from tautscope import tables  # noqa: PLC0415

    profiles = demo.by_profile
    several = len(demo.seeds) > 1
    title = "Table 1: the article, and the twin" + (
        f" (median of {len(demo.seeds)} seeds, worst in brackets)" if several else ""
    )
    figures = [
        (name, tables.median(results), tables.worst(results)) for name, results in profiles.items()
    ]
    table = Table(title=title, box=None, title_justify="left", title_style="bold", pad_edge=False)
    table.add_column("", no_wrap=True)
    for dof in demo.results[0]:
        table.add_column(
            f"{tables.heading(dof)}\narticle", justify="right", style="dim", no_wrap=True
        )
        for name in profiles:
            table.add_column(f"\n{name}", justify="right")
    for row in tables.ROWS:
        cells = []
        for dof in demo.results[0]:
            cells.append(tables.article_cell(row, dof))
            for _, middle, bad in figures:
                ours = tables.cell(row, dof, getattr(middle[dof], row.name))
                worst = f" ({tables.cell(row, dof, getattr(bad[dof], row.name))})"
                cells.append(ours + worst * several)
        table.add_row(row.title, *cells)
    console = _console()
    console.print(table)
    console.print(
        f"\n{demo.sim_seconds:.0f} s simulated in {demo.wall_seconds:.0f} s. "
        f"Widths in the last two periods, of the true tip unless said."
    )
    for warning in demo.compensated.warnings:
        console.print(f"Warning: {warning}", soft_wrap=True)
    console.print(f"Report, figures and traces: {folder / 'report.html'}", soft_wrap=True)


def _print_analysis(found: Analysis, folder: Path) -> None:
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
    console = _console()
    console.print(table)
    console.print(f"\n{_cleaning(found)}", soft_wrap=True)
    console.print(f"Figure and samples: {folder / 'analyze.png'}", soft_wrap=True)


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
