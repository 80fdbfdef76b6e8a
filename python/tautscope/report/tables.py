"""Table 1 with the article's values, and the table of the operator motion: text, CSV, JSON."""

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tautscope.dof import Dof, NamedDof
from tautscope.report.results import ROWS, DofResult, Figures, combine
from tautscope.report.rows import ARTICLE, Row, rows_of

SMALLEST = 0.001
"""Length that a sentence tells from nothing [mm or rad]."""
_SIZES = ("uncompensated", "compensated", "reduction", "reduction_max")
IN_SUMMARY = (*_SIZES, "start_periods", "tracking_rms", "state_rms", "marker_rms_px")
"""Figures that ``--json`` contains."""


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
) -> None:
    """Write figures in display units: per DOF the article's, per profile seeds, median, worst.

    Of an operator motion the article has none.
    """
    lines = [
        (profile, source, found)
        for profile, results in by_profile.items()
        for source, found in [
            *((f"seed {seed}", result) for seed, result in zip(seeds, results, strict=True)),
            ("median", combine(results, "median")),
            ("worst", combine(results, "worst")),
        ]
    ]
    first = lines[0][2]
    rows = rows_of(type(next(iter(first.values()))))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["dof", "unit", "profile", "source", *(row.name for row in rows)])
        for dof in first:
            if rows == ROWS:
                article = [_number(row, dof, ARTICLE.get(row.name, {}).get(dof)) for row in rows]
                writer.writerow([dof.label, dof.display_unit, "", "article", *article])
            for profile, source, result in lines:
                values = [_number(row, dof, getattr(result[dof], row.name)) for row in rows]
                writer.writerow([dof.label, dof.display_unit, profile, source, *values])


def operator_to_json(results: Mapping[NamedDof, Figures]) -> dict[str, dict[str, float | None]]:
    """Figures of an operator motion by DOF [m or rad]; an unknown figure is None."""
    return {dof.label: finite(asdict(figures)) for dof, figures in results.items()}


def median_text(results: Sequence[dict[NamedDof, Any]], rows: Sequence[Row], name: str) -> str:
    """The median of a figure of each DOF, in words."""
    row = next(row for row in rows if row.name == name)
    texts = []
    for dof, found in combine(results, "median").items():
        value, text = getattr(found, name), cell(row, dof, getattr(found, name))
        if row.kind == "length":
            is_small = abs(in_display_unit(row, dof, value)) < SMALLEST
            text = f"{f'below {SMALLEST}' if is_small else text} {dof.display_unit}"
        texts.append(text)
    return " / ".join(texts)


def summary(results: Sequence[dict[NamedDof, DofResult]]) -> dict[str, Any]:
    """Median figures of the seeds by DOF in display units, and under ``worst`` the worst ones."""
    middle, bad = combine(results, "median"), combine(results, "worst")
    return {
        dof.label: {
            "unit": dof.display_unit,
            **_summary(dof, middle[dof]),
            "worst": _summary(dof, bad[dof]),
        }
        for dof in middle
    }


def _summary(dof: NamedDof, result: DofResult) -> dict[str, float | None]:
    rows = [row for row in ROWS if row.name in IN_SUMMARY]
    return finite({row.name: in_display_unit(row, dof, getattr(result, row.name)) for row in rows})


def finite(figures: Mapping[str, float]) -> dict[str, float | None]:
    """Figures by name, None for those that are not finite."""
    return {name: finite_or_none(value) for name, value in figures.items()}


def finite_or_none(value: float) -> float | None:
    """The value, or None if it is not finite, which JSON cannot express."""
    return value if math.isfinite(value) else None


def _number(row: Row, dof: NamedDof, value: float | None) -> str:
    if value is None or math.isnan(value):
        return ""
    return f"{in_display_unit(row, dof, value):.6g}"
