"""What ``tautscope analyze`` prints."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tautscope.commands.printing import console, print_table
from tautscope.errors import RecordError
from tautscope.runs.columns import Column

if TYPE_CHECKING:
    from tautscope.analysis.comparison import Analysis
    from tautscope.analysis.verdict import Verdict


def print_columns(
    file: str,
    columns: Sequence[Column],
    pairs: Sequence[tuple[str, str]],
    left_out: Sequence[RecordError],
) -> None:
    """Print the columns with their ranges, those left out, and commands to continue with."""
    import shlex  # noqa: PLC0415

    rows = []
    for each in columns:
        extent = f"{each.least:.6g}", f"{each.largest:.6g}"
        rows.append((str(each.number), each.title, each.unit, str(each.count), *extent))
    print_table(("number", "title", "unit", "values", "least", "largest"), rows, left=(1, 2))
    screen = console()
    for error in left_out:
        screen.print(f"Left out: {error}", soft_wrap=True)
    print("\nType one of these:" if pairs else "\nNo two columns move together.")
    for command, tip in pairs:
        words = ["tautscope", "analyze", file, "--command", command, "--measured", tip]
        screen.print(f"  {shlex.join(words)}", soft_wrap=True)


def results_to_json(
    results: Sequence[tuple[Verdict, Analysis]], settings: dict[str, Any] | None
) -> dict[str, Any]:
    """Verdicts, all fields of each degree of freedom, and settings of the loop for all of them.

    The comparison of models of a single degree of freedom is also at the top.
    """
    document = {
        "verdict": _text(results),
        "dofs": [verdict.to_json() | analysis.to_json() for verdict, analysis in results],
        "settings": settings,
    }
    return document | results[0][1].to_json() if len(results) == 1 else document


def print_results(results: Sequence[tuple[Verdict, Analysis]], folder: Path) -> None:
    """Print the verdicts, what was written, and of a single record the comparison of models."""
    screen = console()
    screen.print(_text(results), soft_wrap=True)
    if len(results) == 1:
        print()
        _print_models(*results[0])
    print()
    for verdict, analysis in results:
        name = f"{verdict.name}: " if len(results) > 1 else ""
        screen.print(f"{name}{_cleaning(analysis)}", soft_wrap=True)
    screen.print(f"Figures and samples: {folder}", soft_wrap=True)
    known = [verdict.name for verdict, _ in results if verdict.settings is not None]
    others = [verdict for verdict, _ in results if verdict.settings is None]
    if known:
        file = folder / "compensator.toml"
        screen.print(f"Loop of {', '.join(known)}: {file}; to try it: {file.with_suffix('.py')}")
    for is_late, why in ((False, "the slack is not identified"), (True, "the tip is too late")):
        names = [each.name for each in others if each.found.is_identified is is_late]
        if names:
            screen.print(f"No settings for {', '.join(names)}: {why}.")


def _text(results: Sequence[tuple[Verdict, Analysis]]) -> str:
    if len(results) == 1:
        return results[0][0].text
    return "\n\n".join(f"{verdict.name}: {verdict.text}" for verdict, _ in results)


def _print_models(verdict: Verdict, analysis: Analysis) -> None:
    from tautscope.analysis.comparison import HORIZONS  # noqa: PLC0415

    horizons = [f"{100 * share:.0f} %" for share in HORIZONS]
    shown = ("gain", "width") if verdict.found.is_identified else ("gain",)
    rows = []
    for entry in analysis.entries:
        parameters = entry.prediction.parameters
        errors = [entry.rmse, *(error.rmse for error in entry.horizons)]
        found = [f"{parameters[name]:.4g}" if name in parameters else "" for name in shown]
        cells = [f"{error:.4g}" for error in errors] + found
        rows.append([entry.model.title, entry.model.fitted_to, *cells])
    headings = ("model", "fitted to", "every tip", *horizons, *shown)
    title = "Error of the predicted tip, RMS over the second half [tip's unit]"
    print_table(headings, rows, title=title, left=(0, 1))
    console().print(
        "\nevery tip: models fitted off-line get the command alone. 1 % ...: the tip is seen only "
        "after this share of the command's range; off-line models continue from the last tip seen.",
        soft_wrap=True,
    )


def _cleaning(analysis: Analysis) -> str:
    record = analysis.record
    cleaning = record.cleaning
    counts = {
        "lines without a command or time, removed": cleaning.blank,
        "commands interpolated at the tip's times": cleaning.interpolated,
        "lines without a tip, kept but not scored": cleaning.unseen,
        "duplicate lines, removed": cleaning.duplicates,
        "late lines, sorted by time": cleaning.reordered,
        "clock set back, later times shifted": cleaning.clock_steps,
        f"gaps in time, the longest {cleaning.longest_gap:.3g} s": cleaning.gaps,
        "a long record, of whose samples one tip is used in": analysis.every - 1 and analysis.every,
    }
    notes = [f"{what}: {number}" for what, number in counts.items() if number]
    scored = f"{len(record.rows)} samples, {analysis.scored.sum()} of them scored"
    if cleaning.equal_times:
        notes.append("delay in samples: all times are equal")
    elif record.time is None:
        notes.append("delay in samples; order and duplicates not checked without --time")
    return "; ".join([scored, *notes]) + "."
