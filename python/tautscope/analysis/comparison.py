"""``tautscope analyze``: models of hysteresis compared on a record of an actuator and its tip."""

from bisect import bisect_left
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautscope.analysis.models.registry import LINEAR_FIT, MODELS, Model
from tautscope.analysis.models.task import Floats, Prediction, Task, continued, extremes
from tautscope.config import Config
from tautscope.errors import RecordError
from tautscope.report import metrics
from tautscope.report.tables import finite_or_none
from tautscope.runs.records import Record

HORIZONS = (0.01, 0.03, 0.10)
"""Travel of the command between two sights, as a share of its range."""
LEAST_SIGHTS = 8
"""In each half of the record; with fewer a horizon is left out."""
PARTS = 50_000
"""Largest number of measured tips; more do not change an RMS error by more than 0.5 %."""


@dataclass(frozen=True)
class HorizonError:
    """Error of a model that gets the tip only at sights, NaN if there are too few of them.

    Attributes:
        rmse: RMS error over the scored samples [tip's unit]. A model that is fitted off-line
            predicts the change since the last sight.
        alone: The same of an off-line model's output from the command alone; NaN for others.
    """

    rmse: float
    alone: float


@dataclass(frozen=True, eq=False)
class Entry:
    """Result of one model.

    Attributes:
        rmse: RMS error over the scored samples [tip's unit].
        horizons: Errors with sights at the distances `HORIZONS`.
    """

    model: Model
    prediction: Prediction
    rmse: float
    horizons: tuple[HorizonError, ...]


@dataclass(frozen=True, eq=False)
class Analysis:
    """Results of all models on a record.

    Attributes:
        half: First sample of the second half; both halves have equally many measured tips.
        every: Of so many samples one tip is used, see `thinned`.
        entries: One per model, in the order of the registry.
        sights: Number of sights at the distances `HORIZONS`.
    """

    record: Record
    half: int
    every: int
    entries: tuple[Entry, ...]
    sights: tuple[int, ...]

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
            "every": self.every,
            "scored": int(np.count_nonzero(self.scored)),
            "cleaning": asdict(self.record.cleaning),
            "horizons": [
                {"share": share, "sights": sights}
                for share, sights in zip(HORIZONS, self.sights, strict=True)
            ],
            "models": [
                {
                    "name": entry.model.name,
                    "title": entry.model.title,
                    "learns": entry.model.fitted_to,
                    "rmse": finite_or_none(entry.rmse),
                    "share_of_no_model": finite_or_none(self.share(entry)),
                    "horizons": [
                        {
                            "share": share,
                            "rmse": finite_or_none(error.rmse),
                            "rmse_command_alone": finite_or_none(error.alone),
                        }
                        for share, error in zip(HORIZONS, entry.horizons, strict=True)
                    ],
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
    *,
    progress: Callable[[float], None] | None = None,
) -> Analysis:
    """Fit every model to a record, and compute its errors over the second half.

    The errors are those with every measured tip, and those with the tip seen at `HORIZONS` only,
    where fits also get no more than the sights.

    Args:
        record: Actuator and tip, each in any unit.
        config: Its insertion has the settings of the on-line estimators.
        update_distance: tau of the on-line estimators in the tip's unit; by default 1 % of the
            command's range in the first half.
        gain: Tip travel per command travel in contact, 1 if their units are equal; by default
            estimated from the first half.
        models: The models to compare.
        progress: Called with the share of the fits that are done.

    Raises:
        RecordError: Command or tip does not move in the first half.
    """
    record, every = thinned(record)
    half = check_motion(record)
    with_tip = np.flatnonzero(np.isfinite(record.measured))
    task = Task(record.command, record.measured, half, gain, update_distance, config)
    scored = with_tip[with_tip >= half]
    masked = [seen_at(task, share) for share in HORIZONS]
    done, total = count(1), len(models) * (1 + len(masked))

    def count_fit() -> None:
        if progress is not None:
            progress(next(done) / total)

    def entry(model: Model) -> Entry:
        prediction = model.run(task)
        count_fit()
        errors = []
        for seen in masked:
            errors.append(_horizon_error(model, seen, task, scored))
            count_fit()
        return Entry(model, prediction, _rmse(prediction.tip, task, scored), tuple(errors))

    counts = tuple(int(np.isfinite(seen.measured).sum()) for seen in masked)
    return Analysis(record, half, every, tuple(entry(model) for model in models), counts)


def thinned(record: Record) -> tuple[Record, int]:
    """A long record with the last tip of each of `PARTS` parts, and the samples of a part.

    Rates above what the motion needs cost time and add nothing. The extremes of the command in each
    part stay, so that plays turn where they turned.
    """
    size = -(-len(record.command) // PARTS)
    if size < 3:
        return record, 1
    seen = np.flatnonzero(np.isfinite(record.measured))
    last = seen[np.append(np.diff(seen // size) > 0, True)]
    kept = np.union1d(extremes(record.command, size), last)
    measured = np.full(len(record.command), np.nan)
    measured[last] = record.measured[last]
    return replace(record, measured=measured).part(kept), size


def check_motion(record: Record) -> int:
    """First sample of the second half; both halves have equally many measured tips.

    Raises:
        RecordError: There are fewer than two measured tips, or command or tip does not move in the
            first half.
    """
    with_tip = np.flatnonzero(np.isfinite(record.measured))
    if len(with_tip) < 2:
        raise RecordError("measured", f"{len(with_tip)} tips beside commands", "at least 2")
    half = int(with_tip[len(with_tip) // 2])
    first = with_tip[with_tip < half]
    for name, values, moves in (
        ("command", record.command[:half], "a signal that moves"),
        ("measured", record.measured[first], "a tip that moves, in strokes longer than the slack"),
    ):
        if np.ptp(values) == 0:
            raise RecordError(name, f"{values[0]:g} throughout the first half", moves)
    return half


def seen_at(task: Task, share: float) -> Task:
    """The task with the tip at sights only: the other measured tips become NaN.

    The first measured tip is a sight, and then each one before which the command has travelled
    `share` of its range since the last sight.
    """
    travel = np.cumsum(np.abs(np.diff(task.command, prepend=task.command[0])))
    step = share * float(np.ptp(task.command)) * (1 - 1e-9)
    with_tip = np.flatnonzero(np.isfinite(task.measured))
    travels = travel[with_tip].tolist()
    sights, at = [], 0
    while at < len(travels):
        sights.append(with_tip[at])
        at = bisect_left(travels, travels[at] + step, at + 1)
    measured = np.full(len(task.measured), np.nan)
    measured[sights] = task.measured[sights]
    return replace(task, measured=measured)


def _horizon_error(model: Model, seen: Task, task: Task, scored: NDArray[np.intp]) -> HorizonError:
    halves = np.isfinite(seen.measured[: seen.half]), np.isfinite(seen.measured[seen.half :])
    if min(np.count_nonzero(half) for half in halves) < LEAST_SIGHTS:
        return HorizonError(np.nan, np.nan)
    tip = model.run(seen).tip
    if model.uses_sights:
        return HorizonError(_rmse(tip, task, scored), np.nan)
    return HorizonError(
        _rmse(continued(tip, seen.measured), task, scored), _rmse(tip, task, scored)
    )


def _rmse(tip: Floats, task: Task, scored: NDArray[np.intp]) -> float:
    return metrics.rms((tip - task.measured)[scored])
