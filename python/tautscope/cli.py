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

if TYPE_CHECKING:
    from rich.console import Console

    from tautscope.analysis import Analysis
    from tautscope.demo import Demo

PROFILES = get_args(Profile)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; 0 on success, 2 on an error a person can mend, 130 when interrupted."""
    options = _parser().parse_args(arguments)
    try:
        options.run(options)
    except TautscopeError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("interrupted; nothing was written", file=sys.stderr)
        return 130
    return 0


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
        help="run the estimator on a recorded file",
        description="Run the on-line hysteresis estimator over a CSV file of an actuator's and its "
        "tip's position, in one unit. Each sample is predicted before it is learnt from. Lines "
        "with a blank or NaN in one of the columns are left out and counted.",
    )
    analyze.add_argument("file", type=Path, metavar="FILE.csv", help="CSV with a header line")
    analyze.add_argument("--command", required=True, metavar="COL", help="column: actuator")
    analyze.add_argument("--measured", required=True, metavar="COL", help="column: tip")
    analyze.add_argument("--time", metavar="COL", help="column: time, for the figure only")
    analyze.add_argument(
        "--update-distance",
        type=_distance,
        metavar="X",
        help="command travel between two updates, the record's unit [1 %% of the command's range]",
    )
    analyze.add_argument(
        "--out", type=Path, metavar="DIR", help="folder, new or empty [runs/<date-time>-analyze]"
    )
    _add_common(analyze)
    analyze.set_defaults(run=_analyze)
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
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (value > 0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"got {text!r}, expected a number above 0")
    return value


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
    found = analysis.analyze(record, config, options.update_distance)
    analysis.write_analysis(found, folder)
    if options.json:
        _print_json(found.to_json())
    else:
        _print_analysis(found, folder)


def _print_json(document: dict[str, Any]) -> None:
    print(json.dumps(document, allow_nan=False))


def _console() -> Console:
    from rich.console import Console  # noqa: PLC0415

    width = None if sys.stdout.isatty() else 160
    return Console(highlight=False, markup=False, width=width)


def _print_table1(demo: Demo, folder: Path) -> None:
    from rich.table import Table  # noqa: PLC0415

    from tautscope import tables  # noqa: PLC0415

    profiles = {demo.config.profile: demo.results}
    if demo.article_results:
        profiles = {"paper": demo.article_results, **profiles}
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
    console.print(f"Report, figures and traces: {folder / 'report.html'}", soft_wrap=True)


def _print_analysis(found: Analysis, folder: Path) -> None:
    from rich.table import Table  # noqa: PLC0415

    dropped = found.record.dropped
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column("")
    table.add_column("", justify="right")
    lines = {
        "samples": f"{len(found.predicted)}" + (f" ({dropped} lines left out)" if dropped else ""),
        "update distance": f"{found.update_distance:.4g}",
        "delta_minus, at the end": f"{found.delta_minus[-1]:.4g}",
        "delta_plus, at the end": f"{found.delta_plus[-1]:.4g}",
        "backlash width": f"{found.width:.4g}",
        "prediction error, second half (RMS)": f"{found.rmse:.4g}",
        "... of the command itself": f"{found.rmse_no_model:.4g}",
        "... of the command less a constant": f"{found.rmse_constant:.4g}",
    }
    for name, value in lines.items():
        table.add_row(name, value)
    console = _console()
    console.print(table)
    if not 0.5 < found.slope < 2:
        console.print(
            f"The tip moves {found.slope:.3g} per unit of command: are both in one unit and one "
            "direction? The model takes a scale of one."
        )
    console.print(f"Figure and samples: {folder / 'analyze.png'}", soft_wrap=True)
