"""Output of ``tautscope replay``: the estimates as a table or as JSON."""

import argparse
import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from tautscope.commands.printing import print_json, print_table
from tautscope.log.comparison import estimation_quality, write_replay
from tautscope.report.tables import finite
from tautscope.runs.recording import Recording


def write_estimates(
    options: argparse.Namespace,
    folder: Path,
    replayed: Recording,
    recorded: Recording | None,
    facts: Mapping[str, Any] = MappingProxyType({}),
) -> None:
    """Write the folder of a replay, and print its estimates beside the recorded ones.

    Args:
        options: Of the command.
        folder: The new folder.
        replayed: The estimates.
        recorded: Those of the run, if there was one.
        facts: Further entries of the JSON object.
    """
    write_replay(folder, replayed, recorded)
    after = estimation_quality(replayed, recorded)
    before = None if recorded is None else estimation_quality(recorded)
    dofs = {label: {"replayed": finite(figures)} for label, figures in after.items()}
    for label, figures in (before or {}).items():
        dofs[label]["recorded"] = finite(figures)
    images = len(replayed.frames)
    print_json(options, {"folder": str(folder), "images": images, **facts, "dof": dofs})
    _print_table(replayed, before, after)
    print(f"\nFigure and data: {folder / 'replay.png'}")


def _print_table(
    replayed: Recording,
    before: dict[str, dict[str, float]] | None,
    after: dict[str, dict[str, float]],
) -> None:
    noun = "measurements" if replayed.config.dof else "images"
    dofs = replayed.config.dofs
    headings = [""]
    for dof in dofs:
        unit = f"{dof.label} [{dof.display_unit}]"
        headings += [f"{unit}\nrecorded", "\nreplayed"] if before else [unit]
    rows = []
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
            rows.append([title, *cells])
    title = f"Estimates from {len(replayed.frames)} {noun}"
    print_table(headings, rows, title=title, dim=range(1, len(headings), 2) if before else ())


def _cell(value: float, name: str, scale: float) -> str:
    if math.isnan(value):
        return "unknown" if name == "width" else ""
    return f"{100 * value:.0f} %" if name == "seen" else f"{scale * value:.3g}"
