"""From the outcomes of the soak to rows with goals, and to a table."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from common.rows import goal_row
from soak.cases import Case, Outcome
from tautscope.dof import Dof

Row = dict[str, Any]
RATIO_GOAL = 1.15
"""Largest error of a later tenth over that of the second."""
COVERAGE_GOAL = 0.95
"""Least share of the time in which an interval contains the truth."""
REFERENCE_PART = 1
"""The second tenth; the first one has the start."""


def ratio(outcome: Outcome, dof: Dof) -> float:
    """Largest error of the tenths after the second over that of the second."""
    errors = np.array(outcome.errors)[:, dof]
    return float(errors[REFERENCE_PART + 1 :].max() / errors[REFERENCE_PART])


def to_rows(found: Mapping[Case, Outcome]) -> list[Row]:
    """Rows of each case and DOF, a value per seed."""
    rows = []
    for name, outcomes in _by_name(found).items():
        for dof in Dof:
            for what, values, goal, sense in _quantities(outcomes, dof):
                row = goal_row(
                    f"{name}: {what}",
                    "ratio" if sense == "max" else "share",
                    values,
                    goal,
                    sense,
                    dof=dof.label,
                    profile="best",
                )
                rows.append({**row, "case": name, "quantity": what})
    return rows


def _by_name(found: Mapping[Case, Outcome]) -> dict[str, list[Outcome]]:
    groups: dict[str, list[Outcome]] = {}
    for case, outcome in found.items():
        groups.setdefault(case.name, []).append(outcome)
    return groups


def _quantities(
    outcomes: Sequence[Outcome], dof: Dof
) -> Iterator[tuple[str, list[float], float, str]]:
    """Quantity, value per seed, goal, sense."""
    ratios = [ratio(each, dof) for each in outcomes]
    yield "error over the second tenth's", ratios, RATIO_GOAL, "max"
    for name in outcomes[0].coverage:
        shares = [each.coverage[name][dof] for each in outcomes]
        yield f"{name} within 3 sigma", shares, COVERAGE_GOAL, "min"


def table(found: Mapping[Case, Outcome]) -> str:
    """Return a Markdown table: a line per case, each DOF of the seed with its largest ratio."""
    labels = " | ".join(f"{dof.label} [{dof.display_unit}]" for dof in Dof)
    lines = [f"| case | {labels} | ratio |", "|---|--:|--:|--:|--:|"]
    for name, outcomes in _by_name(found).items():
        cells = [name]
        for dof in Dof:
            worst = max(outcomes, key=lambda outcome: ratio(outcome, dof))
            errors = dof.display_scale * np.array(worst.errors)[REFERENCE_PART:, dof]
            cells.append(f"{errors[0]:.3g}, {errors[1:].max():.3g}")
        value = max(ratio(each, dof) for each in outcomes for dof in Dof)
        cells.append(f"{value:.2f}" + ("" if value <= RATIO_GOAL else " (missed)"))
        lines.append(f"| {' | '.join(cells)} |")
    held = max(outcome.held for outcome in found.values())
    shares = [share for each in found.values() for of in each.coverage.values() for share in of]
    notes = [f"Held: at most {100 * held:.1f} % of the images of a case."]
    if shares:
        notes.append(f"Within 3 sigma: at least {100 * min(shares):.0f} % of the time.")
    return "\n".join([*lines, "", " ".join(notes)])
