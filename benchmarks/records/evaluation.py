"""Errors of all models on a record, and what the weighted mixture does after a change."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from records import families, tools
from tautscope.analysis.comparison import HORIZONS, analyze, seen_at
from tautscope.analysis.models import last_tip, mixture
from tautscope.analysis.models.task import Task
from tautscope.config import load_config
from tautscope.report.metrics import rms
from tautscope.runs.records import Cleaning, Record

Floats = NDArray[np.float64]
CLOSE = 1.2
"""A changed slack is followed while the error is below this multiple of its final value."""
WORSE = 1.05
"""Least ratio of two errors that counts as worse."""


@dataclass(frozen=True)
class Result:
    """Results at one horizon.

    Attributes:
        ratio: RMS error of the mixture over that of the best other model, each off-line model
            with and without the last tip seen.
        best: Name of that model.
        predicting: The same without the constant play, which is fitted to the scored samples.
        worse_strokes: Largest number of successive strokes in which the better of the two trivial
            predictors is better than the mixture by more than `WORSE`.
        strokes_to_follow: Strokes after the last splice until the error is below that of both
            trivial predictors for good; None without a splice.
        strokes_to_settle: The same, until the error is below `CLOSE` times its final value.
    """

    ratio: float
    best: str
    predicting: float
    worse_strokes: int
    strokes_to_follow: int | None
    strokes_to_settle: int | None


Job = tuple[str, int]
"""Name of a family with a seed, or of a record of a tool with 0."""


def evaluate(job: Job) -> list[Result]:
    """Results per horizon of a record."""
    name, seed = job
    is_drawn = name in families.FAMILIES
    command, measured = families.record(name, seed) if is_drawn else tools.read(name)
    record = Record(command, measured, None, np.arange(len(command)), Cleaning())
    config = load_config()
    found = analyze(record, config)
    task = Task(command, measured, found.half, None, None, config)
    results = []
    for at, share in enumerate(HORIZONS):
        errors = {
            entry.model.name: float(np.nanmin([entry.horizons[at].rmse, entry.horizons[at].alone]))
            for entry in found.entries
        }
        mixed = errors.pop("best")
        best = min(errors, key=errors.__getitem__)
        predicting = min(error for other, error in errors.items() if other != "play")
        seen = seen_at(task, share)
        models = (mixture.run, last_tip.run, last_tip.run_with_gain)
        tips = [model(seen).tip - measured for model in models]
        mixture_strokes, *trivial = (_per_stroke(error, task) for error in tips)
        is_worse = mixture_strokes > WORSE * np.minimum(*trivial)
        after = None, None
        if name in tools.SPLICED:
            after = _after_change(tips, command, len(command) * 2 // 3)
        results.append(
            Result(mixed / errors[best], best, mixed / predicting, _longest(is_worse), *after)
        )
    return results


def turning_points(command: Floats) -> list[int]:
    """Samples at which the command turns after at least half its range, and both ends."""
    least = 0.5 * float(np.ptp(command))
    points, extreme, side = [0], 0, 0
    for k, value in enumerate(command):
        if side == 0 and abs(value - command[0]) >= least:
            side = 1 if value > command[0] else -1
            extreme = k
        elif side and side * (value - command[extreme]) > 0:
            extreme = k
        elif side and side * (command[extreme] - value) >= least:
            points.append(extreme)
            side, extreme = -side, k
    return [*points, len(command)]


def _per_stroke(error: Floats, task: Task) -> Floats:
    """RMS errors after each travel of the command by its range, over the second half."""
    travel = np.cumsum(np.abs(np.diff(task.command, prepend=task.command[0])))
    stroke = ((travel - travel[task.half]) / np.ptp(task.command)).astype(int)
    stroke[: task.half] = -1
    return np.array([rms(error[stroke == number]) for number in range(stroke[-1])])


def _after_change(errors: list[Floats], command: Floats, change: int) -> tuple[int, int]:
    """Strokes until the mixture's error, the first one, is below the others', and has settled.

    A stroke lasts from one turning point to the next. The final value is the median of the last
    three strokes in the same direction.
    """
    points = [change + point for point in turning_points(command[change:])]
    strokes, *trivial = (
        np.array([rms(error[a:b]) for a, b in pairwise(points)]) for error in errors
    )
    final = np.array([np.median(strokes[k % 2 :: 2][-3:]) for k in range(len(strokes))])
    return _last(strokes > np.minimum(*trivial)), _last(strokes > CLOSE * final)


def _last(flags: NDArray[np.bool_]) -> int:
    """Number of elements up to the last true one; 0 without any."""
    return int(np.max(np.flatnonzero(flags), initial=-1)) + 1


def _longest(flags: NDArray[np.bool_]) -> int:
    longest = current = 0
    for flag in flags:
        current = current + 1 if flag else 0
        longest = max(longest, current)
    return longest
