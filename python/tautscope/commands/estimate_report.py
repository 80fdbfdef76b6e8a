"""Output of ``tautscope replay``: the estimates as a table or as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rich.table import Table

from tautscope.commands.printing import console, print_json
from tautscope.log.comparison import estimation_quality, write_replay
from tautscope.report.tables import finite
from tautscope.runs.recording import Recording


def write_estimates(
    folder: Path,
    replayed: Recording,
    recorded: Recording | None,
    *,
    as_json: bool,
    facts: Mapping[str, Any] = MappingProxyType({}),
) -> None:
    """Write the folder of a replay, and print its estimates beside the recorded ones.

    Args:
        folder: The new folder.
        replayed: The estimates.
        recorded: Those of the run, if there was one.
        as_json: Whether to print JSON.
        facts: Further entries of the JSON object.
    """
    write_replay(folder, replayed, recorded)
    after = estimation_quality(replayed, recorded)
    before = None if recorded is None else estimation_quality(recorded)
    if as_json:
        document: dict[str, Any] = {
            "folder": str(folder),
            "images": len(replayed.frames),
            **facts,
            "dof": {},
        }
        for label, figures in after.items():
            entry = {"replayed": finite(figures)}
            if before is not None:
                entry["recorded"] = finite(before[label])
            document["dof"][label] = entry
        print_json(document)
        return
    _print_table(replayed, before, after)
    print(f"\nFigure and data: {folder / 'replay.png'}")


def _print_table(
    replayed: Recording,
    before: dict[str, dict[str, float]] | None,
    after: dict[str, dict[str, float]],
) -> None:
    noun = "measurements" if replayed.config.dof else "images"
    table = Table(box=None, pad_edge=False, title_justify="left", title_style="bold")
    table.title = f"Estimates from {len(replayed.frames)} {noun}"
    table.add_column("", no_wrap=True)
    dofs = replayed.config.dofs
    for dof in dofs:
        unit = f"{dof.label} [{dof.display_unit}]"
        if before is not None:
            table.add_column(f"{unit}\nrecorded", justify="right", style="dim", no_wrap=True)
        table.add_column("\nreplayed" if before else unit, justify="right", no_wrap=True)
    for title, name in (
        ("backlash width at the end", "width"),
        (f"{noun} with the DOF observable", "seen"),
        ("RMS error of the estimate", "state_rms"),
        ("RMS change of the estimate", "change_rms"),
    ):
        cells = []
        for dof in dofs:
            pair = [each[dof.label] for each in (before, after) if each is not None]
            cells += [_cell(each[name], name, dof.display_scale) for each in pair]
        if any(cells):
            table.add_row(title, *cells)
    console().print(table)


def _cell(value: float, name: str, scale: float) -> str:
    if math.isnan(value):
        return "unknown" if name == "width" else ""
    return f"{100 * value:.0f} %" if name == "seen" else f"{scale * value:.3g}"
