"""From the figures of the runs to rows per seed, and to quantities over all seeds."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np
from common.rows import goal_row
from instruments.properties import draw_instrument
from instruments.runs import Figures, Motion, Run, Variant
from numpy.typing import NDArray
from tautscope.dof import Dof

Floats = NDArray[np.float64]
Row = dict[str, Any]

MEDIAN_GOAL = {Dof.INSERTION: 0.82, Dof.ROTATION: 0.75, Dof.BENDING: 0.80}
LOW_GOAL = {Dof.INSERTION: 0.66, Dof.ROTATION: 0.62, Dof.BENDING: 0.68}
"""Least reduction under an operator's motion: of the median, and of the 5th percentile."""
LOW = 5.0
"""Percentile."""
MARGIN = 0.03
"""By which `best` may be worse than `paper`."""
STOPPED = -1.0
"""Reduction that stands for a run that ended early."""
REFUSED = ("refused", "partial", "no_markers")
"""Statuses of an image that was not used although both bands were visible."""


def seed_rows(found: Mapping[Run, Figures]) -> list[Row]:
    """A row for each seed and motion: the drawn properties, and the figures of each variant.

    Without those of which a run is missing.
    """
    rows: dict[tuple[str, int], Row] = {}
    for run, figures in sorted(found.items(), key=lambda item: (item[0].motion, item[0].seed)):
        key = run.motion, run.seed
        if key not in rows:
            values = draw_instrument(run.seed).values
            rows[key] = {"seed": run.seed, "motion": run.motion, "properties": values, "runs": {}}
        rows[key]["runs"][run.variant] = asdict(figures)
    variants = {run.variant for run in found}
    rows = {key: row for key, row in rows.items() if set(row["runs"]) == variants}
    for row in rows.values():
        free = row["runs"].get("none")
        for name, figures in row["runs"].items():
            if name != "none" and free is not None:
                figures["reduction"] = [
                    STOPPED if figures["stopped"] else 1 - after / before
                    for before, after in zip(free["spread"], figures["spread"], strict=True)
                ]
    return list(rows.values())


def reductions(rows: Iterable[Row], motion: Motion, variant: Variant) -> Floats:
    """(seeds, 3) reductions of a variant; empty if it was not run."""
    found = [
        row["runs"][variant]["reduction"]
        for row in rows
        if row["motion"] == motion and "reduction" in row["runs"].get(variant, {})
    ]
    return np.array(found).reshape(-1, 3)


def refused_shares(rows: Iterable[Row], motion: Motion, variant: Variant) -> Floats:
    """(seeds,) share of the images with both bands visible that were not used."""
    found = []
    for row in rows:
        figures = row["runs"].get(variant)
        if row["motion"] == motion and figures is not None and figures["visible"]:
            refused = sum(figures["statuses"].get(status, 0) for status in REFUSED)
            found.append(refused / figures["visible"])
    return np.array(found)


def median_shift(rows: Iterable[Row], motion: Motion, variant: Variant) -> Floats:
    """(3,) median size of the constant part of the tracking error [m, rad, rad]."""
    found = [row["runs"][variant]["shift"] for row in rows if row["motion"] == motion]
    return np.asarray(np.nanmedian(np.abs(found), axis=0))


def summary_rows(rows: list[Row]) -> list[Row]:
    """The rows of `goal_row` with the goals of the operator's motion, per DOF."""
    best, paper = (reductions(rows, "hand", name) for name in ("best", "paper"))
    exact, n = reductions(rows, "hand", "best exact"), len(best)
    # Quantity, DOF, value, goal, sense.
    values: list[tuple[str, Dof | None, float, float, str]] = []
    for dof in Dof if n else ():
        mine = best[:, dof]
        values += [
            ("reduction, median", dof, float(np.median(mine)), MEDIAN_GOAL[dof], "min"),
            (
                "reduction, 5th percentile",
                dof,
                float(np.percentile(mine, LOW)),
                LOW_GOAL[dof],
                "min",
            ),
            ("worse than none", dof, float((mine < 0).mean()), 0.0, "max"),
        ]
        if len(paper):
            worse = float((mine < paper[:, dof] - MARGIN).mean())
            values.append(("worse than paper by 3 points", dof, worse, 0.01, "max"))
        if len(exact):
            lost = float(np.median(exact[:, dof] - mine))
            values.append(("lost by what is told wrongly, median", dof, lost, 0.05, "max"))
    shares = refused_shares(rows, "hand", "best")
    if len(shares):
        values.append(("visible images not used", None, float(shares.mean()), 0.01, "max"))
    return [
        goal_row(
            what,
            "share",
            [value],
            goal,
            sense,
            dof=None if dof is None else dof.label,
            profile="best",
            n=n,
        )
        for what, dof, value, goal, sense in values
    ]


def table(rows: list[Row], motion: Motion) -> str:
    """Return a Markdown table of all variants for one motion."""
    best, paper = (reductions(rows, motion, name) for name in ("best", "paper"))
    lines = [
        "| variant | median | 5th percentile | worst (seed) | worse than none "
        "| worse than paper by 3 points | shift [mm, rad] | images not used |",
        "|---|--:|--:|--:|--:|--:|--:|--:|",
    ]
    seeds = [row["seed"] for row in rows if row["motion"] == motion]
    for variant in ("paper", "best", "best exact"):
        mine = 100 * reductions(rows, motion, variant)
        if not len(mine):
            continue
        shares = refused_shares(rows, motion, variant)
        shift = [dof.display_scale for dof in Dof] * median_shift(rows, motion, variant)
        is_compared = variant != "paper" and len(paper)
        worse = (mine < 100 * (paper - MARGIN)).sum(axis=0) if is_compared else ()
        cells = (
            variant,
            " / ".join(f"{each:.0f}" for each in np.median(mine, axis=0)) + " %",
            " / ".join(f"{each:.0f}" for each in np.percentile(mine, LOW, axis=0)) + " %",
            " / ".join(
                f"{mine[at, dof]:.0f} ({seeds[at]})" for dof, at in enumerate(mine.argmin(axis=0))
            ),
            " / ".join(map(str, (mine < 0).sum(axis=0))),
            " / ".join(map(str, worse)),
            " / ".join(f"{each:.2g}" for each in shift),
            f"{100 * shares.mean():.1f} %" if len(shares) else "",
        )
        lines.append(f"| {' | '.join(cells)} |")
    exact = reductions(rows, motion, "best exact")
    if len(exact) and len(best):
        lost = 100 * (exact - best)
        cells = (
            f"{dof.label} {np.median(lost[:, dof]):.0f} ({lost[:, dof].max():.0f})" for dof in Dof
        )
        lines += ["", f"Lost by what is told wrongly, points, median (worst): {', '.join(cells)}."]
    return "\n".join(lines)


def seed_table(rows: list[Row]) -> str:
    """A line per seed and motion: the reductions in percent, and the images not used."""
    lines = [
        "| seed | motion | paper | best | best exact | not used |",
        "|--:|---|---|---|---|--:|",
    ]
    for row in rows:
        cells = [str(row["seed"]), row["motion"]]
        for variant in ("paper", "best", "best exact"):
            figures = row["runs"].get(variant, {})
            values = figures.get("reduction", [])
            text = " / ".join(f"{100 * value:.0f}" for value in values)
            cells.append("stopped" if figures.get("stopped") else text)
        shares = refused_shares([row], row["motion"], "best")
        cells.append(f"{100 * shares[0]:.1f} %" if len(shares) else "")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)
