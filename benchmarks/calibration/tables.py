"""Tables of the calibration benchmark, as Markdown."""

from collections.abc import Sequence

import numpy as np
from calibration.evaluation import Outcome, column
from instruments.rows import STOPPED
from tautscope.dof import Dof

LOW = 0.9
"""Share of the truths in their 95 % intervals below which a parameter is named."""


def error_table(title: str, outcomes: Sequence[Outcome]) -> str:
    """Median and worst error of each quantity, and whether its interval holds the truth."""
    names = list(outcomes[0].errors)
    sizes = np.abs([[each.errors[name] for name in names] for each in outcomes]).round(9)
    errors = zip(np.median(sizes, axis=0), sizes.max(axis=0), strict=True)
    plausible = sum(each.is_plausible for each in outcomes)
    cells = (
        title,
        *(f"{median:.2g} ({worst:.2g})" for median, worst in errors),
        f"{plausible} of {len(outcomes)}",
        f"{coverage(outcomes):.0%}{_low_coverages(outcomes)}",
    )
    head = ("instrument", *names, "plausible", "truths in their intervals")
    return f"| {' | '.join(head)} |\n|{'---|' * len(head)}\n| {' | '.join(cells)} |"


def coverage(outcomes: Sequence[Outcome]) -> float:
    """Share of the truths in their 95 % intervals."""
    return float(np.mean([list(each.inside.values()) for each in outcomes]))


def _low_coverages(outcomes: Sequence[Outcome]) -> str:
    names = outcomes[0].inside
    shares = {name: np.mean([each.inside[name] for each in outcomes]) for name in names}
    low = ", ".join(f"{name} {share:.0%}" for name, share in shares.items() if share < LOW)
    return f" ({low})" if low else ""


def loop_table(outcomes: Sequence[Outcome]) -> str:
    """State error and tracking error of the loop by what it is told.

    A run that ended early counts as a reduction of -100 %; it has no state error.
    """
    lines = [
        "| DOF | state error, calibrated over exact: median (worst) | told over exact | reduction "
        "of the tracking RMS, calibrated | exact | told | loss in points: median (worst) |",
        "|---|--:|--:|--:|--:|--:|--:|",
    ]
    for dof in Dof:
        exact = column(outcomes, "state", "exact", dof)
        ratio = column(outcomes, "state", "calibrated", dof) / exact
        before = column(outcomes, "state", "told", dof) / exact
        plain = column(outcomes, "hand", "none", dof)
        left = {}
        for name in ("calibrated", "exact", "told"):
            share = 1 - column(outcomes, "hand", name, dof) / plain
            left[name] = 100 * np.where(np.isnan(share), STOPPED, share)
        loss = left["exact"] - left["calibrated"]
        lines.append(
            f"| {dof.label} | {np.nanmedian(ratio):.2f} ({np.nanmax(ratio):.2f}) | "
            f"{np.nanmedian(before):.2f} | {np.median(left['calibrated']):.0f} % | "
            f"{np.median(left['exact']):.0f} % | {np.median(left['told']):.0f} % | "
            f"{np.median(loss):.1f} ({np.max(loss):.1f}) |"
        )
    return "\n".join(lines)


def alarm_table(outcomes: Sequence[Outcome]) -> str:
    """How often each contradiction was recognised."""
    lines = ["| record | recognised |", "|---|--:|"]
    for name in outcomes[0].alarms:
        rings = sum(each.alarms[name] for each in outcomes)
        lines.append(f"| {name} | {rings} of {len(outcomes)} |")
    return "\n".join(lines)
