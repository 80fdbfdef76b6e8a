"""Results of ``tautscope run``, and its run folder."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.hardware.timing import Timing
from tautscope.log.writer import LogSummary
from tautscope.report.operator_motion import OperatorResults, evaluate_operator_motion
from tautscope.report.results import Results, evaluate
from tautscope.report.tables import finite_or_none, operator_to_json
from tautscope.runs.recording import Recording, Table


@dataclass(frozen=True)
class ProtocolRun:
    """One run of the protocol.

    Attributes:
        recording: Traces of the loop.
        timing: Timing of set-points and frames.
        log: Summary of its log.
    """

    recording: Recording
    timing: Timing
    log: LogSummary


@dataclass(frozen=True)
class HardwareRun:
    """Results of ``tautscope run``.

    Attributes:
        config: The configuration used.
        compensated: The run with compensation.
        uncompensated: The run without compensation, if it was requested.
    """

    config: Config
    compensated: ProtocolRun
    uncompensated: ProtocolRun | None = None

    @property
    def results(self) -> Results:
        """Table 1 from the state estimates; NaN where it needs an uncompensated run.

        Empty for a recorded motion.
        """
        return evaluate(self._plain, self.compensated.recording)

    @property
    def operator_results(self) -> OperatorResults:
        """Tracking of a recorded motion by the state estimates; empty for the experiment."""
        recording = self.compensated.recording
        return {} if recording.segments else evaluate_operator_motion(self._plain, recording)

    @property
    def _plain(self) -> Recording | None:
        return None if self.uncompensated is None else self.uncompensated.recording

    def to_json(self) -> dict[str, Any]:
        """The output of ``tautscope run --json``; widths in m or rad, None if unknown."""
        runs = {"compensated": self.compensated}
        if self.uncompensated is not None:
            runs = {"uncompensated": self.uncompensated, **runs}
        return {
            "profile": self.config.profile,
            "runs": {name: _summary(run) for name, run in runs.items()},
            "by_camera": {
                dof.label: {
                    "uncompensated": finite_or_none(found.uncompensated_estimate),
                    "compensated": finite_or_none(found.compensated_estimate),
                    "reduction": finite_or_none(found.reduction_estimate),
                    "tracking_rms": finite_or_none(found.tracking_estimate),
                }
                for dof, found in self.results.items()
            }
            | operator_to_json(self.operator_results),
        }


def write_run_folder(run: HardwareRun, folder: Path) -> None:
    """Write tables, timing, figures and report into the folder of the logs."""
    from tautscope.figure_style import style  # noqa: PLC0415
    from tautscope.hardware.timing_figure import timing_figure  # noqa: PLC0415  matplotlib
    from tautscope.report import figures, report, tables  # noqa: PLC0415  matplotlib takes half a second
    from tautscope.report.operator_figure import draw_operator_motion  # noqa: PLC0415

    first, results = run.compensated, run.results
    first.recording.write(folder)
    timing = timing_figure(first.timing)
    plain = None if run.uncompensated is None else run.uncompensated.recording
    if first.recording.segments:
        name, section = "fig9.png", report.table1_section(results)
        main = report.CaptionedFigure(
            figures.figure9(plain, first.recording),
            "Fig. 9. (a)-(c) with compensation: reference, command, estimate and both contact "
            "offsets. (d)-(f) loops of the estimate; a narrow loop on the dashed line, an ideal "
            "tip, is the goal. The first period, in which the slack is estimated, is thin.",
        )
    else:
        name, section = "tracking.png", report.recorded_motion_section(run.operator_results)
        main = report.CaptionedFigure(
            draw_operator_motion(plain, first.recording),
            "The recorded motion. (a)-(c) reference, command and the tip as the camera measures "
            "it, in a part of the run. (d)-(f) tracking error over the whole run.",
        )
    shown = [
        main,
        report.CaptionedFigure(
            timing,
            "Timing of the run. (a), (b) delay of each set-point after its due time; "
            "(c), (d) age of each frame when the loop took it.",
        ),
    ]
    if run.uncompensated is not None:
        run.uncompensated.recording.write(folder, "_uncompensated")
        run.uncompensated.timing.write(folder, "_uncompensated")
    if results:
        tables.write_csv(
            folder / "table1.csv", [run.config.twin.seed], {run.config.profile: [results]}
        )
    facts = {
        "control": f"{1 / first.timing.cycle:g} Hz, {first.timing.lost} cycles lost",
        "log": first.log.path.name,
    }
    with style():
        timing.savefig(folder / "timing.png")
        main.figure.savefig(folder / name)
        page = report.run_report(
            run.config,
            facts,
            section,
            shown,
            first.recording.warnings,
        )
    (folder / "report.html").write_text(page, encoding="utf-8")
    (folder / "run.json").write_text(json.dumps(run.to_json(), indent=1), encoding="utf-8")
    first.timing.write(folder)


def _summary(run: ProtocolRun) -> dict[str, Any]:
    frames = run.recording.frames
    return {
        "log": str(run.log.path),
        "log_complete": run.log.is_complete,
        "ticks": len(run.recording.trace),
        "status": dict(Counter(frames["status"].tolist())),
        "observable": _observable_fractions(frames),
        "timing": run.timing.summary(),
        "warnings": list(run.recording.warnings),
    }


def _observable_fractions(frames: Table) -> dict[str, float | None]:
    return {
        dof.label: finite_or_none(float(frames[f"observable_{dof.label}"].mean()))
        if len(frames)
        else None
        for dof in Dof
    }
