"""``tautscope analyze``: models of hysteresis compared on a record of an actuator and its tip."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.analysis.models.registry import LINEAR_FIT, MODELS, Model
from tautscope.analysis.models.task import Prediction, Task
from tautscope.config import Config
from tautscope.errors import RecordError
from tautscope.report import metrics
from tautscope.report.tables import finite_or_none
from tautscope.runs.records import Record


@dataclass(frozen=True, eq=False)
class Entry:
    """Result of one model.

    Attributes:
        model: The model.
        prediction: Its prediction.
        rmse: RMS error over the scored samples [tip's unit].
    """

    model: Model
    prediction: Prediction
    rmse: float


@dataclass(frozen=True, eq=False)
class Analysis:
    """Results of all models on a record.

    Attributes:
        record: The record.
        half: First sample of the second half; both halves have equally many measured tips.
        entries: One per model, in the order of the registry.
    """

    record: Record
    half: int
    entries: tuple[Entry, ...]

    @property
    def scored(self) -> NDArray[np.bool_]:
        """(n,) the scored samples: those of the second half with a measured tip."""
        return np.isfinite(self.record.measured) & (np.arange(len(self.record.rows)) >= self.half)

    def share(self, entry: Entry) -> float:
        """RMSE relative to that of the linear fit; NaN if the linear fit is exact."""
        (linear,) = [other.rmse for other in self.entries if other.model is LINEAR_FIT]
        return entry.rmse / linear if linear > 0 else float("nan")

    def to_json(self) -> dict[str, Any]:
        """The output of ``tautscope analyze --json``."""
        return {
            "samples": len(self.record.rows),
            "scored": int(np.count_nonzero(self.scored)),
            "cleaning": asdict(self.record.cleaning),
            "models": [
                {
                    "name": entry.model.name,
                    "title": entry.model.title,
                    "learns": entry.model.fitted_to,
                    "rmse": finite_or_none(entry.rmse),
                    "share_of_no_model": finite_or_none(self.share(entry)),
                    "parameters": dict(entry.prediction.parameters),
                }
                for entry in self.entries
            ],
        }


def analyze(
    record: Record,
    config: Config,
    update_distance: float | None = None,
    gain: float | None = None,
    models: tuple[Model, ...] = MODELS,
) -> Analysis:
    """Fit every model to a record, and compute its error over the second half.

    Args:
        record: Actuator and tip, each in any unit.
        config: Its insertion has the settings of the on-line estimators.
        update_distance: tau of the on-line estimators in the tip's unit; by default 1 % of the
            command's range in the first half.
        gain: Tip travel per command travel in contact, 1 if their units are equal; by default
            estimated from the first half.
        models: The models to compare.

    Raises:
        RecordError: Command or tip does not move in the first half.
    """
    with_tip = np.flatnonzero(np.isfinite(record.measured))
    half = int(with_tip[len(with_tip) // 2])
    first = with_tip[with_tip < half]
    for name, values in (("command", record.command[:half]), ("measured", record.measured[first])):
        if np.ptp(values) == 0:
            raise RecordError(
                name, f"{values[0]:g} throughout the first half", "a signal that moves"
            )
    task = Task(record.command, record.measured, half, gain, update_distance, config)
    scored = with_tip[with_tip >= half]

    def entry(model: Model) -> Entry:
        prediction = model.run(task)
        errors = (prediction.tip - record.measured)[scored]
        return Entry(model, prediction, metrics.rms(errors))

    return Analysis(record, half, tuple(entry(model) for model in models))
