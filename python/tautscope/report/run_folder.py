"""Figures, tables and report.html of one or two recorded runs, in a folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from tautscope.report import tables
from tautscope.report.report import FIGURE5_CAPTION, CaptionedFigure, run_report

if TYPE_CHECKING:
    from tautscope.report.recorded_run import RecordedRun


def write_report(
    run: RecordedRun,
    place: Path,
    facts: Mapping[str, str],
    further: Sequence[tuple[str, CaptionedFigure]] = (),
) -> None:
    """Write report.html, its figures, and table1.csv of the experiment, into an existing folder.

    Args:
        run: The run, and perhaps one without compensation.
        place: The folder.
        facts: Further facts of the run.
        further: Further figures, by the names of their files.
    """
    # Matplotlib takes half a second to import.
    from tautscope.figure_style import style  # noqa: PLC0415
    from tautscope.report.figures import figure5  # noqa: PLC0415

    recording, config = run.main, run.main.config
    pictures = [run.figure(), *further]
    if recording.snapshot is not None:
        drawn = figure5(recording.snapshot, config)
        pictures.append(("fig5.png", CaptionedFigure(drawn, FIGURE5_CAPTION)))
    if results := run.results:
        tables.write_csv(place / "table1.csv", [config.twin.seed], {config.profile: [results]})
    with style():
        for name, captioned in pictures:
            captioned.figure.savefig(place / name)
        shown = [captioned for _, captioned in pictures]
        page = run_report(config, {**facts}, run.section(), shown, recording.warnings)
    (place / "report.html").write_text(page, encoding="utf-8")
