"""Results of ``tautscope run``, and its run folder."""

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.hardware.timing import Timing
from tautscope.log.writer import LogSummary
from tautscope.report.recorded_run import RecordedRun
from tautscope.report.tables import finite_or_none
from tautscope.runs.recording import Recording


@dataclass(frozen=True)
class ProtocolRun:
    """One run of the protocol."""

    recording: Recording
    timing: Timing
    log: LogSummary


@dataclass(frozen=True)
class HardwareRun:
    """Results of ``tautscope run``."""

    config: Config
    compensated: ProtocolRun
    uncompensated: ProtocolRun | None = None

    @property
    def recorded(self) -> RecordedRun:
        """The recordings, and their figures of merit."""
        plain = None if self.uncompensated is None else self.uncompensated.recording
        return RecordedRun(self.compensated.recording, plain)

    def to_json(self) -> dict[str, Any]:
        """The output of ``tautscope run --json``; widths in m or rad, None if unknown."""
        runs = {"compensated": self.compensated}
        if self.uncompensated is not None:
            runs = {"uncompensated": self.uncompensated, **runs}
        return {
            "profile": self.config.profile,
            "runs": {name: _summary(run) for name, run in runs.items()},
            "by_camera": self.recorded.to_json(),
        }


def write_run_folder(run: HardwareRun, folder: Path) -> None:
    """Write tables, timing, figures and report into the folder of the logs."""
    from tautscope.hardware.timing_figure import timing_figure  # noqa: PLC0415  matplotlib

    first, recorded = run.compensated, run.recorded
    first.recording.write(folder)
    timing = (
        "timing.png",
        timing_figure(first.timing),
        "Timing of the run. (a), (b) delay of each set-point after its due time; "
        "(c), (d) age of each frame when the loop took it.",
    )
    if run.uncompensated is not None:
        run.uncompensated.recording.write(folder, "_uncompensated")
        run.uncompensated.timing.write(folder, "_uncompensated")
    facts = {
        "control": f"{1 / first.timing.cycle:g} Hz, {first.timing.lost} cycles lost",
        "log": first.log.path.name,
    }
    recorded.write_report(folder, facts, [timing])
    (folder / "run.json").write_text(json.dumps(run.to_json(), indent=1), encoding="utf-8")
    first.timing.write(folder)


def _summary(run: ProtocolRun) -> dict[str, Any]:
    frames = run.recording.frames
    return {
        "log": str(run.log.path),
        "log_complete": run.log.is_complete,
        "ticks": len(run.recording.trace),
        "status": dict(Counter(frames["status"].tolist())),
        "observable": {
            dof.label: finite_or_none(float(frames[f"observable_{dof.label}"].mean()))
            if len(frames)
            else None
            for dof in Dof
        },
        "timing": run.timing.summary(),
        "warnings": list(run.recording.warnings),
    }
