"""``tautscope analyze``: models of hysteresis compared on a record of any actuator and its tip."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.analysis.models.registry import MODELS, NO_MODEL, Model
from tautscope.analysis.models.task import Prediction, Task
from tautscope.config import Config
from tautscope.errors import RecordError
from tautscope.report import metrics
from tautscope.report.tables import finite_or_none
from tautscope.runs.replay import Record


@dataclass(frozen=True, eq=False)
class Entry:
    """One model on the record.

    Attributes:
        model: Which.
        prediction: What it said.
        rmse: Of its prediction over the samples of the second half with a tip [tip's unit].
    """

    model: Model
    prediction: Prediction
    rmse: float


@dataclass(frozen=True, eq=False)
class Analysis:
    """All models on one record.

    Attributes:
        record: What was read.
        half: First sample of the second half: as many samples with a tip before it as after.
        entries: One per model, in the order of the registry.
    """

    record: Record
    half: int
    entries: tuple[Entry, ...]

    @property
    def scored(self) -> NDArray[np.bool_]:
        """(n,) samples that count: those of the second half with a tip."""
        return np.isfinite(self.record.measured) & (np.arange(len(self.record.rows)) >= self.half)

    def share(self, entry: Entry) -> float:
        """RMSE over that without a model; NaN where a straight line is exact."""
        (none,) = [other.rmse for other in self.entries if other.model is NO_MODEL]
        return entry.rmse / none if none > 0 else float("nan")

    def to_json(self) -> dict[str, Any]:
        """What ``tautscope analyze --json`` prints."""
        return {
            "samples": len(self.record.rows),
            "scored": int(np.count_nonzero(self.scored)),
            "cleaning": asdict(self.record.cleaning),
            "models": [
                {
                    "name": entry.model.name,
                    "title": entry.model.title,
                    "learns": entry.model.learns,
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
    """Fit every model to a record and score its prediction over the second half.

    Args:
        record: Actuator and tip, each in any unit.
        config: Contact tolerance and smoothing factor are those of its insertion.
        update_distance: tau of the on-line estimators in the tip's unit; without it 1 % of the
            command's range in the first half.
        gain: Tip travel per command travel in contact, 1 for one unit; without it learnt from the
            first half.
        models: Those of the registry.

    Raises:
        RecordError: Command or tip does not move in the first half.
    """
    with_tip = np.flatnonzero(np.isfinite(record.measured))
    half = int(with_tip[len(with_tip) // 2])
    first = with_tip[with_tip < half]
    for name, values in (("command", record.command[:half]), ("measured", record.measured[first])):
        if np.ptp(values) == 0:
            raise RecordError(name, f"{values[0]:g} throughout the first half", "one that moves")
    task = Task(record.command, record.measured, half, gain, update_distance, config)
    counted = with_tip[with_tip >= half]

    def entry(model: Model) -> Entry:
        prediction = model.run(task)
        errors = (prediction.tip - record.measured)[counted]
        return Entry(model, prediction, metrics.rms(errors))

    return Analysis(record, half, tuple(entry(model) for model in models))
