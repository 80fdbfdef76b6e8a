"""Table 1 with the article's values, and the table of the operator motion: text, CSV, JSON."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tautscope.dof import Dof, NamedDof
from tautscope.report.results import DofResult, Figures, Results, combine
from tautscope.report.rows import ARTICLE, ROWS, Row


def median(results: Sequence[dict[NamedDof, Figures]]) -> dict[NamedDof, Figures]:
    """Median of every figure over the seeds."""
    return combine(results, "median")


def worst(
    results: Sequence[dict[NamedDof, Figures]], rows: Sequence[Row] = ROWS
) -> dict[NamedDof, Figures]:
    """Worst value of every figure over the seeds."""
    return combine(results, {row.name: row.worst for row in rows})


def in_display_unit(row: Row, dof: NamedDof, value: float) -> float:
    """A figure [m or rad] in the display unit."""
    return value * dof.display_scale if row.kind == "length" else value


def heading(dof: NamedDof) -> str:
    """The title of a DOF's columns, with the unit of its lengths."""
    return f"{dof.label} [{dof.display_unit}]"


def cell(row: Row, dof: NamedDof, value: float) -> str:
    """A figure as text in its display unit; a dash if it is not known."""
    if math.isnan(value):
        return "-"
    if row.kind == "share":
        return f"{100 * value:.0f} %"
    if row.kind == "count":
        return f"{value:g}"
    shown = in_display_unit(row, dof, value)
    return f"{shown:.3g}" if abs(shown) >= 1 else f"{shown:.2g}"


def exact_cell(row: Row, dof: NamedDof, value: float) -> str:
    """A figure with a digit more than `cell` and its unit, to compare it with a goal."""
    if math.isnan(value):
        return "not known"
    if row.kind == "share":
        return f"{100 * value:.1f} %"
    unit = f" {dof.display_unit}" if row.kind == "length" else ""
    return f"{in_display_unit(row, dof, value):.4g}{unit}"


def goal_text(row: Row) -> str:
    """The goal of a row in display units: ``at most 2 mm, 0.5 rad, 0.25 rad``."""
    if row.goal is None:
        return ""
    texts = []
    for dof in Dof:
        text = cell(row, dof, row.limit(dof) or 0.0)
        texts.append(f"{text} {dof.display_unit}" if row.kind == "length" else text)
    joined = texts[0] if len(set(texts)) == 1 else ", ".join(texts)
    return f"at {'least' if row.worst == 'min' else 'most'} {joined}"


def article_cell(row: Row, dof: NamedDof, by_camera: bool = False) -> str:
    """The figure as the article's Table 1 prints it, or nothing.

    The article measured by camera: with `by_camera` its figures stand in the rows "by camera".
    """
    name = row.name.removesuffix("_estimate") if by_camera else row.name
    value = ARTICLE.get(name, {}).get(dof)
    return "" if value is None else cell(row, dof, value)


def write_csv(
    path: Path,
    seeds: Sequence[int],
    by_profile: Mapping[str, Sequence[dict[NamedDof, Figures]]],
    rows: Sequence[Row] = ROWS,
) -> None:
    """Write figures in display units: per DOF the article's, per profile seeds, median, worst.

    Of an operator motion, `OPERATOR_ROWS`, the article has none.
    """
    lines = [
        (profile, source, found)
        for profile, results in by_profile.items()
        for source, found in _sources(seeds, results, rows)
    ]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["dof", "unit", "profile", "source", *(row.name for row in rows)])
        for dof in lines[0][2]:
            if rows is ROWS:
                article = [_number(row, dof, ARTICLE.get(row.name, {}).get(dof)) for row in rows]
                writer.writerow([dof.label, dof.display_unit, "", "article", *article])
            for profile, source, result in lines:
                values = [_number(row, dof, getattr(result[dof], row.name)) for row in rows]
                writer.writerow([dof.label, dof.display_unit, profile, source, *values])


def _sources(
    seeds: Sequence[int], results: Sequence[dict[NamedDof, Figures]], rows: Sequence[Row]
) -> list[tuple[str, dict[NamedDof, Figures]]]:
    """The figures of every seed, their median and the worst, each with its name."""
    return [
        *((f"seed {seed}", result) for seed, result in zip(seeds, results, strict=True)),
        ("median", median(results)),
        ("worst", worst(results, rows)),
    ]


def to_json(
    profile: str,
    seeds: Sequence[int],
    results: Sequence[Results],
    operator_results: Sequence[dict[NamedDof, Figures]],
    *,
    sim_seconds: float,
    wall_seconds: float,
    article_results: Sequence[Results] = (),
) -> dict[str, Any]:
    """The output of ``tautscope demo --json``; an unknown figure is None.

    Medians over the seeds, and under ``worst`` the worst values; insertion in mm. Under ``paper``
    the results of the article's scheme, if it was run beside another one. Under ``hand`` the
    medians of the operator motion's figures, in m and rad.
    """
    return {
        "profile": profile,
        "seeds": list(seeds),
        "dof": _by_dof(results),
        **({"paper": _by_dof(article_results)} if article_results else {}),
        "hand": operator_to_json(median(operator_results)),
        "sim_seconds": sim_seconds,
        "wall_seconds": wall_seconds,
    }


def operator_to_json(results: Mapping[NamedDof, Figures]) -> dict[str, dict[str, float | None]]:
    """Figures of an operator motion by DOF [m or rad]; an unknown figure is None."""
    return {
        dof.label: {name: finite_or_none(value) for name, value in asdict(figures).items()}
        for dof, figures in results.items()
    }


def _by_dof(results: Sequence[Results]) -> dict[str, Any]:
    middle, bad = median(results), worst(results)
    return {
        dof.label: {
            "unit": dof.display_unit,
            **_summary(dof, middle[dof]),
            "worst": _summary(dof, bad[dof]),
        }
        for dof in results[0]
    }


def _summary(dof: NamedDof, result: DofResult) -> dict[str, float | None]:
    values = asdict(result)
    return {
        row.name: finite_or_none(in_display_unit(row, dof, values[row.name]))
        for row in ROWS
        if row.in_summary
    }


def finite_or_none(value: float) -> float | None:
    """The value, or None if it is not finite, which JSON cannot express."""
    return value if math.isfinite(value) else None


def _number(row: Row, dof: NamedDof, value: float | None) -> str:
    if value is None or math.isnan(value):
        return ""
    return f"{in_display_unit(row, dof, value):.6g}"
