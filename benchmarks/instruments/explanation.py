"""Which properties explain the reductions: a forest's permutation importance."""

import numpy as np
from instruments.properties import TABLE
from instruments.rows import Row, reductions
from instruments.runs import Motion
from scipy.stats import spearmanr
from sklearn.ensemble import RandomForestRegressor
from sklearn.inspection import permutation_importance
from tautscope.dof import Dof

LEAST_SEEDS = 20
"""Fewer say nothing about this many properties."""
SHOWN = 3
TREES = 100


def explain(rows: list[Row], motion: Motion) -> str:
    """Describe, per DOF, what the reduction of `best` depends on.

    A forest is fitted to all properties and, per property, the loss of explained variance (R^2)
    by shuffling it is measured; the sign is that of Spearman's rank correlation.

    Wrong when two properties act only together, or with few seeds: the importance is that for the
    seeds it was fitted to.
    """
    found = reductions(rows, motion, "best")
    if len(found) < LEAST_SEEDS:
        return f"Too few seeds to explain the reductions: {len(found)}, least {LEAST_SEEDS}."
    names = [each.name for each in TABLE]
    # The size of a property of both signs counts, besides its value.
    two_sided = [each.name for each in TABLE if each.low < 0]
    kept = [row for row in rows if row["motion"] == motion and "reduction" in row["runs"]["best"]]
    values = np.array([[row["properties"][name] for name in names] for row in kept])
    sizes = np.abs(values[:, [names.index(name) for name in two_sided]])
    values, labels = np.hstack([values, sizes]), [*names, *(f"|{name}|" for name in two_sided)]
    parts = []
    for dof in Dof:
        reduction = 100 * found[:, dof]
        forest = RandomForestRegressor(TREES, min_samples_leaf=3, random_state=0)
        forest.fit(values, reduction)
        importance = permutation_importance(
            forest, values, reduction, n_repeats=5, random_state=0
        ).importances_mean
        shown = [
            f"{labels[k]} {importance[k]:.2f} ({spearmanr(values[:, k], reduction).statistic:+.2f})"
            for k in np.argsort(-importance)[:SHOWN]
        ]
        parts.append(f"{dof.label}: {', '.join(shown)}")
    return "\n".join(parts)
