"""The command ``tautscope report``: tables and figures of a stored run."""

import argparse
from pathlib import Path

from tautscope.commands import arguments
from tautscope.commands.printing import print_json
from tautscope.commands.result_lines import print_results
from tautscope.runs.output_folder import new_folder


def add_parser(verbs: arguments.Verbs) -> None:
    """Add the command to the parser."""
    report = arguments.add_verb(
        verbs,
        "report",
        _run,
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


def _run(options: argparse.Namespace) -> None:
    from tautscope.log.stored_run import read_run  # noqa: PLC0415
    from tautscope.report.report import report_time  # noqa: PLC0415

    folder = arguments.out_folder(options)
    run = read_run(options.path, options.uncompensated)
    recording = run.main
    time, seen = recording.trace["time"], "measurements" if recording.config.dof else "images"
    began = {} if recording.began is None else {"began": report_time(recording.began)}
    facts = {
        "run": str(run.source),
        **began,
        "recorded": f"{time[-1] - time[0]:.1f} s, {len(recording.frames)} {seen}",
    }
    with new_folder(folder) as place:
        run.write_report(place, facts)
    print_json(options, {"folder": str(folder), "source": str(run.source), **run.summary()})
    print_results(run, folder)
