"""The compensator of an identified record, on plays that are fitted to the other half of it."""

from dataclasses import dataclass

import numpy as np
from records import continuum, tools
from tautscope.analysis.compensation import as_played, plant, run
from tautscope.analysis.compensator import compensator, scale_of
from tautscope.analysis.verdict import judge
from tautscope.runs.records import Cleaning, Record


@dataclass(frozen=True)
class Reduction:
    """Reduction of the RMS error of the tip, in [0, 1].

    Attributes:
        source: Part of the record with the slack: a half if it is identified there, else all.
        said: By the verdict of this part.
        found: By its compensator, on plays fitted to the other half.
    """

    source: str
    said: float
    found: float


def evaluate(name: str) -> list[Reduction]:
    """Both halves of a record as the other one; empty if its slack is not identified."""
    source = continuum if name in continuum.RECORDS else tools
    command, measured = source.read(name)
    rows = np.arange(len(command))

    def part(where: slice) -> Record:
        return Record(command[where], measured[where], None, rows[where], Cleaning())

    whole = judge(part(slice(None)))
    if whole.compensation is None:
        return []
    half = len(command) // 2
    first, second = (judge(part(each)) for each in (slice(half), slice(half, None)))
    found = []
    for own, other in ((first, second), (second, first)):
        used = whole if own.compensation is None else own
        own_motion = as_played(used.record, used.found)
        settings, scale = compensator({"tip": own_motion}), scale_of(*own_motion)
        played, _ = as_played(other.record, other.found)
        reached = run(settings, played, *plant(other.record, other.found), scale=scale)
        assert used.compensation is not None
        said = 1 - used.compensation.after / used.compensation.before
        label = "all" if used is whole else "first half" if own is first else "second half"
        found.append(Reduction(label, said, 1 - reached.after / reached.before))
    return found


def table(found: dict[str, list[Reduction]]) -> str:
    """Markdown: said and found, per record and half."""
    lines = ["| record | slack of | said | other half | difference |", "|---|---|--:|--:|--:|"]
    known = [(name, each) for name, halves in found.items() for each in halves]
    for name, each in known:
        change = 100 * (each.found - each.said)
        lines.append(
            f"| {name} | {each.source} | {each.said:.0%} | {each.found:.0%} | {change:+.0f} |"
        )
    close = sum(abs(each.found - each.said) <= 0.1 for _, each in known)
    lines += ["", f"Within 10 points: {close} of {len(known)}."]
    return "\n".join(lines)
