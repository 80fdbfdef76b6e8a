"""The command ``tautscope report``: tables and figures of a stored run."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tautscope.commands import arguments
from tautscope.commands.hardware import result_lines
from tautscope.commands.printing import print_json

if TYPE_CHECKING:
    from tautscope.log.stored_run import StoredRun


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    report = arguments.add_verb(
        verbs,
        "report",
        help="tables and figures of a stored run",
        description="Write report.html, figures and tables of a stored run: of a log of `run`, "
        "`console` or `ros2`, also a truncated one, of a run folder, or of tables of `export`. "
        "Reductions need a run with compensation and one without, of the same reference. Of an "
        "experiment that ended early, the degrees of freedom whose part is complete are evaluated.",
        extras=["hardware"],
    )
    report.add_argument("path", type=Path, metavar="PATH", help="FILE.mcap, or a folder with a run")
    report.add_argument(
        "--uncompensated",
        type=Path,
        metavar="PATH",
        help="the run without compensation [the one in the same folder, if there is one]",
    )
    arguments.add_out(report, "report")
    arguments.add_json(report)
    report.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> None:
    from tautscope.log.stored_run import read_run  # noqa: PLC0415
    from tautscope.runs.output_folder import check_free, default_folder  # noqa: PLC0415

    folder = check_free(options.out or default_folder("report"))
    stored = read_run(options.path, options.uncompensated)
    _write(stored, folder)
    if options.json:
        print_json({"folder": str(folder), **_to_json(stored)})
        return
    for line in result_lines(stored.run):
        print(line)
    for warning in stored.run.main.warnings:
        print(f"Warning: {warning}.")
    print(f"Report and figures: {folder / 'report.html'}")


def _to_json(stored: StoredRun) -> dict[str, Any]:
    recording = stored.run.main
    return {
        "source": str(stored.source),
        "profile": recording.config.profile,
        "is_compensated": recording.compensated,
        "ticks": len(recording.trace),
        "images": len(recording.frames),
        "is_tip_known": stored.run.is_tip_known,
        "dof": stored.run.to_json(),
        "warnings": list(recording.warnings),
    }


def _write(stored: StoredRun, folder: Path) -> None:
    from tautscope.figure_style import style  # noqa: PLC0415
    from tautscope.report import tables  # noqa: PLC0415
    from tautscope.report.figures import figure5  # noqa: PLC0415
    from tautscope.report.report import (  # noqa: PLC0415
        FIGURE5_CAPTION,
        CaptionedFigure,
        run_report,
    )
    from tautscope.runs.output_folder import new_folder  # noqa: PLC0415

    run = stored.run
    recording = run.main
    pictures = [run.figure()]
    if recording.snapshot is not None:
        drawn = figure5(recording.snapshot, recording.config)
        pictures.append(("fig5.png", CaptionedFigure(drawn, FIGURE5_CAPTION)))
    time = recording.trace["time"]
    facts = {
        "run": str(stored.source),
        "recorded": f"{time[-1] - time[0]:.1f} s, {len(recording.frames)} images",
    }
    with new_folder(folder) as place, style():
        for name, captioned in pictures:
            captioned.figure.savefig(place / name)
        if results := run.results:
            profile, seed = recording.config.profile, recording.config.twin.seed
            tables.write_csv(place / "table1.csv", [seed], {profile: [results]})
        shown = [captioned for _, captioned in pictures]
        page = run_report(recording.config, facts, run.section(), shown, recording.warnings)
        (place / "report.html").write_text(page, encoding="utf-8")
