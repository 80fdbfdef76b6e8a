"""``tautscope analyze``: the estimator on a record of any actuator and its tip."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike

import numpy as np
from numpy.typing import NDArray

from tautscope import metrics
from tautscope.config import Config
from tautscope.dof import Dof
from tautscope.errors import RecordError
from tautscope.output import new_folder
from tautscope.replay import Record, predict_tip
from tautscope.tables import finite_or_none

Floats = NDArray[np.float64]

UPDATE_SHARE = 0.01
"""Update distance, as a share of the command's range, if none is given."""


@dataclass(frozen=True, eq=False)
class Analysis:
    """What the estimator makes of a record, in the record's unit.

    Attributes:
        record: What was read.
        update_distance: tau of Eqs. (4)-(6).
        predicted: (n,) tip, each sample predicted before it is seen.
        delta_minus: (n,) contact offset after each sample.
        delta_plus: (n,) contact offset after each sample.
        rmse: Of the prediction, over the second half.
        rmse_no_model: Of taking the tip to be where the command is, over the second half.
        rmse_constant: Of command less a constant, the mean difference in the first half; over the
            second half.
        slope: Of measured over command by least squares; far from 1 the two are not in one unit.
    """

    record: Record
    update_distance: float
    predicted: Floats
    delta_minus: Floats
    delta_plus: Floats
    rmse: float
    rmse_no_model: float
    rmse_constant: float
    slope: float

    @property
    def width(self) -> float:
        """Estimated backlash width at the end."""
        return float(self.delta_plus[-1] - self.delta_minus[-1])

    def to_json(self) -> dict[str, float | int | None]:
        """What ``tautscope analyze --json`` prints."""
        return {
            "samples": len(self.predicted),
            "dropped": self.record.dropped,
            "update_distance": self.update_distance,
            "delta_minus": float(self.delta_minus[-1]),
            "delta_plus": float(self.delta_plus[-1]),
            "width": self.width,
            "rmse": finite_or_none(self.rmse),
            "rmse_no_model": finite_or_none(self.rmse_no_model),
            "rmse_constant": finite_or_none(self.rmse_constant),
            "slope": finite_or_none(self.slope),
        }


def analyze(record: Record, config: Config, update_distance: float | None = None) -> Analysis:
    """Run the estimator over a record.

    Args:
        record: Actuator and tip in one unit.
        config: Contact tolerance and smoothing factor are those of its insertion.
        update_distance: tau in the record's unit; without it 1 % of the command's range.

    Raises:
        RecordError: The command never moves.
    """
    from tautscope._core import Estimator  # noqa: PLC0415

    extent = float(np.ptp(record.command))
    if extent == 0:
        raise RecordError("command", f"{record.command[0]:g} throughout", "a command that moves")
    tau = UPDATE_SHARE * extent if update_distance is None else update_distance
    settings = config[Dof.INSERTION]
    estimator = Estimator(
        update_distance=tau,
        contact_tolerance=settings.contact_tolerance,
        smoothing_factor=settings.smoothing_factor,
        delta_minus=0.0,
        delta_plus=0.0,
    )
    predicted, delta_minus, delta_plus = predict_tip(record.command, record.measured, estimator)
    half = len(predicted) // 2
    constant = np.mean(record.command[:half] - record.measured[:half])
    command, measured = record.command[half:], record.measured[half:]
    slope = np.polyfit(record.command, record.measured, 1)[0]
    return Analysis(
        record=record,
        update_distance=tau,
        predicted=predicted,
        delta_minus=delta_minus,
        delta_plus=delta_plus,
        rmse=metrics.rms(predicted[half:] - measured),
        rmse_no_model=metrics.rms(command - measured),
        rmse_constant=metrics.rms(command - constant - measured),
        slope=float(slope),
    )


def write_analysis(analysis: Analysis, folder: str | PathLike[str]) -> None:
    """Make a folder with analysis.csv (every sample) and analyze.png, or nothing.

    Raises:
        OutputError: The folder holds something already, or cannot be written.
    """
    from tautscope import figures  # noqa: PLC0415  matplotlib takes half a second

    record = analysis.record
    columns = (record.command, record.measured, analysis.predicted)
    deltas = (analysis.delta_minus, analysis.delta_plus)
    figure = figures.analysis_figure(analysis)
    with new_folder(folder) as place, figures.style():
        np.savetxt(
            place / "analysis.csv",
            np.column_stack([record.rows, *columns, *deltas]),
            delimiter=",",
            header="line,command,measured,predicted,delta_minus,delta_plus",
            comments="",
            fmt=["%d", *["%.9g"] * 5],
        )
        figure.savefig(place / "analyze.png")
