"""The loop's own filter on real records, beside the trivial predictors and the mixture."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from common.rows import goal_row
from numpy.typing import NDArray
from records import continuum, tools
from tautscope.analysis.comparison import HORIZONS, analyze
from tautscope.analysis.models.registry import MODELS
from tautscope.config import load_config
from tautscope.runs.records import Cleaning, Record

Floats = NDArray[np.float64]
Errors = dict[str, list[float]]
"""By name of the model: RMS error at each of `HORIZONS` [tip's unit]; NaN with too few sights."""
FILTER, MIXTURE = "filter", "best"
TRIVIAL = ("last_tip", "last_tip_gain")
COMPARED = (FILTER, *TRIVIAL, MIXTURE)
TRIVIAL_GOAL = {0.01: 1.05, 0.03: 1.0, 0.10: 1.05}
"""Largest ratio to the better trivial predictor on any record, by horizon."""
MIXTURE_GOAL = 1.15
"""Largest median of the ratio to the mixture."""
BASELINE_GOAL = 0.6
"""Largest median of the ratio to stored errors of another state of the filter."""
SHOWN = 0.03
"""Horizon at which the filter's error is in the table."""


def records() -> list[str]:
    """Names of the records: tools, tools spliced, axes of the continuum robot."""
    found = tools.tools()
    return [*found, *(tools.SPLICED if found else ()), *continuum.robots()]


def evaluate(name: str) -> Errors:
    """Errors of the compared models on a record."""
    source = continuum if name in continuum.RECORDS else tools
    command, measured = source.read(name)
    record = Record(command, measured, None, np.arange(len(command)), Cleaning())
    models = tuple(model for model in MODELS if model.name in COMPARED)
    entries = analyze(record, load_config(profile="best"), models=models).entries
    return {entry.model.name: [each.rmse for each in entry.horizons] for entry in entries}


def trivial_ratio(errors: Errors, at: int) -> float:
    """Error of the filter over that of the better trivial predictor, at a horizon."""
    return errors[FILTER][at] / min(errors[name][at] for name in TRIVIAL)


def to_rows(
    found: Mapping[str, Errors], baseline: Mapping[str, Errors] | None = None
) -> list[dict[str, Any]]:
    """Rows per record and horizon, then over all records.

    Args:
        found: Errors by record.
        baseline: Errors of another state, by record; adds the ratio to its filter.
    """
    rows = []

    def add(name: str, share: float, what: str, values: Sequence[float], goal: float) -> None:
        row = goal_row(f"{name}, {share:.0%}: {what}", "1", values, goal, profile=FILTER)
        rows.append(row | {"record": name, "horizon": share, "quantity": what})

    for at, share in enumerate(HORIZONS):
        known = {name: each for name, each in found.items() if np.isfinite(each[FILTER][at])}
        trivial = {name: trivial_ratio(each, at) for name, each in known.items()}
        mixture = [each[FILTER][at] / each[MIXTURE][at] for each in known.values()]
        for name, ratio in trivial.items():
            what = "filter over the better trivial predictor"
            add(name, share, what, [ratio], TRIVIAL_GOAL[share])
        if known:
            add("records", share, "filter over the mixture", mixture, MIXTURE_GOAL)
            worst = [max(trivial.values())]
            what = "filter over the better trivial predictor, worst"
            add("records", share, what, worst, TRIVIAL_GOAL[share])
        before = [
            each[FILTER][at] / baseline[name][FILTER][at]
            for name, each in known.items()
            if baseline is not None and name in baseline
        ]
        if before:
            what = "filter over the baseline's"
            add("records", share, what, before, BASELINE_GOAL)
    return rows


def table(found: Mapping[str, Errors], rows: Sequence[dict[str, Any]]) -> str:
    """Markdown: ratios to the better trivial predictor and to the mixture, and an error."""
    columns = range(len(HORIZONS))
    shares = " | ".join(f"{100 * share:.0f} %" for share in HORIZONS)
    lines = [
        f"| median (worst) | {shares} | error at {100 * SHOWN:.0f} % |",
        f"|---|{'--:|' * (len(HORIZONS) + 1)}",
    ]
    groups: dict[str, list[Errors]] = {}
    for name, errors in found.items():
        groups.setdefault(group(name), []).append(errors)
    for name, each in groups.items():
        cells = [spread([trivial_ratio(errors, at) for errors in each]) for at in columns]
        cells.append(spread([errors[FILTER][HORIZONS.index(SHOWN)] for errors in each], ".3g"))
        lines.append(f"| {name}, {len(each)} | {' | '.join(cells)} |")
    for what in ("filter over the mixture", "filter over the baseline's"):
        own = [row for row in rows if row["record"] == "records" and row["quantity"] == what]
        if own:
            cells = [f"{row['median']:.2f} ({row['worst']:.2f})" for row in own]
            lines.append(f"| all, {what} | {' | '.join(cells)} | |")
    behind = [sum(trivial_ratio(each, at) > 1 for each in found.values()) for at in columns]
    lines.append(f"| worse than trivial | {' | '.join(map(str, behind))} | |")
    return "\n".join(lines)


def group(name: str) -> str:
    """The kind of a record: tools, rolls of a tool, the continuum robot, or itself."""
    kinds = {"tool": "tools", "rolls": "rolls", "continuum": "continuum robot"}
    return next((kind for start, kind in kinds.items() if name.startswith(start)), name)


def spread(values: Sequence[float], digits: str = ".2f") -> str:
    """Median, and of several values the largest."""
    worst = f" ({max(values):{digits}})" if len(values) > 1 else ""
    return f"{np.median(values):{digits}}{worst}"
