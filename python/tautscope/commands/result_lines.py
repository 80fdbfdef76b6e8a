"""The results of a recorded run as printed lines."""

import math
from pathlib import Path

from tautscope.commands.printing import print_warnings
from tautscope.dof import NamedDof
from tautscope.report.operator_motion import OperatorResult
from tautscope.report.recorded_run import RecordedRun
from tautscope.report.results import DofResult


def print_results(run: RecordedRun, folder: Path) -> None:
    """Print a line of results per DOF, the warnings, and where the report is."""
    for dof, result in run.results.items():
        slack = _shown(dof, result.uncompensated_estimate)
        plain = f"{dof.label}: without compensation slack {slack}, by camera"
        print(summary_line(dof, result) if run.main.compensated else plain)
    for dof, tracking in run.operator_results.items():
        error = _shown(dof, tracking.uncompensated_rms)
        plain = f"{dof.label}: without compensation tracking error {error} RMS, {run.tip}"
        print(_tracking_line(dof, tracking, run.tip) if run.main.compensated else plain)
    print_warnings(run.main.warnings)
    print(f"Report, figures and traces: {folder / 'report.html'}")


def summary_line(dof: NamedDof, result: DofResult) -> str:
    """One line of results of a DOF from its state estimates; a dash for unknown values."""
    line = f"{dof.label}: remaining slack {_shown(dof, result.compensated_estimate)}"
    if not math.isnan(result.uncompensated_estimate):
        reduction = result.reduction_estimate
        percent = "-" if math.isnan(reduction) else f"{reduction:z.0%}"
        line += f" of {_shown(dof, result.uncompensated_estimate)}, reduction {percent}"
    return f"{line}; tracking error {_shown(dof, result.tracking_estimate)} RMS; by camera"


def _tracking_line(dof: NamedDof, result: OperatorResult, tip: str) -> str:
    """One line of the tracking of a recorded motion; a dash for unknown values."""
    line = f"{dof.label}: tracking error {_shown(dof, result.compensated_rms)} RMS"
    if not math.isnan(result.reduction):
        before = _shown(dof, result.uncompensated_rms)
        line += f", without compensation {before}, reduction {result.reduction:z.0%}"
    largest, slack = _shown(dof, result.largest), _shown(dof, result.slack)
    return f"{line}; largest {largest}; {tip}; slack found {slack}"


def _shown(dof: NamedDof, value: float) -> str:
    return "-" if math.isnan(value) else f"{dof.display_scale * value:.3g} {dof.display_unit}"
