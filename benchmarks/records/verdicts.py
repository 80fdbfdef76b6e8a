"""Verdicts on all real records, beside those of a reader who has seen the figures."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from records import continuum, tools
from records.honest import SAYS
from tautscope.analysis.slide import slide
from tautscope.analysis.verdict import Verdict, judge
from tautscope.runs.records import Cleaning, Record

LAG = "a lag without slack explains the record as well"
JUDGEMENTS = {
    "tool4_L4_run00": (
        "unknown",
        "four strokes, of which the first ends 2° lower. The verdict does not name this",
    ),
    "tool4_L4_run14": ("slack", "the width of the loop in the figure"),
    "tool4_L4_run23": ("slack", "as run14"),
    "tool4_L4_run41": ("slack", "rounded ends"),
    "tool4_R5_run10": ("slack", "sharp corners, the widest loop"),
    "tool4_pitch2_run000": (
        "slack",
        "of the loop, 3°, 0.8° are called a delay, at one speed",
    ),
    "tool4_roll1_run000": (
        "unknown",
        "timid: a loop of 3°, half of which is called a delay, at one speed",
    ),
    "tool4_roll3_run000": ("unknown", "timid: as roll1"),
    "tool4_roll5_run000": ("slack", "the upper end is rounder than the lower one"),
    "continuum seg1, axis 1": ("no slack", "a line, slightly bent, which is named"),
    "continuum seg1, axis 2": ("unknown", "the other axis moves the tip by more than slack"),
    "continuum seg2, axis 1": ("no slack", "a line"),
    "continuum seg2, axis 2": ("unknown", "as seg1, axis 2"),
    "continuum seg3, axis 1": ("unknown", "loops to both sides, from the other axis"),
    "continuum seg3, axis 2": ("unknown", "loops of all sizes, few strokes"),
    "continuum pair12 same, axis 1": (
        "unknown",
        "the line bends at both ends, which is named",
    ),
    "continuum pair12 same, axis 2": (
        "no slack",
        "the tip turns back at the end of a stroke, by 40 mm: the other axis",
    ),
    "continuum pair12 opp, axis 1": ("unknown", "loops of 10 mm, from coupling or slack"),
    "continuum pair12 opp, axis 2": ("unknown", "as axis 1"),
    "continuum pair13 same, axis 1": ("no slack", "a fan in which the tip leads: the other axis"),
    "continuum pair13 same, axis 2": ("unknown", "two lines, from the other axis"),
    "continuum pair13 opp, axis 1": (
        "unknown",
        "timid: a person would suspect a slack of 5 mm",
    ),
    "continuum pair13 opp, axis 2": ("unknown", "timid: as axis 1"),
    "continuum pair23 same, axis 1": ("unknown", "an S, which is named"),
    "continuum pair23 same, axis 2": ("unknown", "an S, which is named"),
    "continuum pair23 opp, axis 1": ("unknown", "the tip moves while this axis rests"),
    "continuum pair23 opp, axis 2": ("unknown", "the gain differs between both sides"),
}
"""By record: what the verdict said when it was read, and the judgement of the reader."""
OBJECTIONS = ("timid", "wrong")
"""Beginnings of the judgements of a verdict that is not simply right."""


@dataclass(frozen=True)
class Answer:
    """A verdict in short.

    Attributes:
        says: One of `SAYS`.
        slack: Width with its interval, its limit, its interval alone, or why there is none.
        text: The verdict.
    """

    says: str
    slack: str
    text: str


def names() -> list[str]:
    """Tools, and axes of the continuum robot."""
    return [*tools.tools(), *continuum.robots()]


def read(name: str) -> Record:
    """A real record, with its units."""
    source, unit = (continuum, "mm") if name in continuum.RECORDS else (tools, "deg")
    command, measured = source.read(name)
    return Record(command, measured, None, np.arange(len(command)), Cleaning(), units=(unit, unit))


def evaluate(job: tuple[str, Path | None]) -> Answer:
    """Judge a record, and draw its figure into a folder if there is one."""
    name, folder = job
    verdict = judge(read(name))
    if folder is not None:
        slide(verdict).savefig(folder / f"{name}.png", dpi=100)
    return _answer(verdict)


def _answer(verdict: Verdict) -> Answer:
    found = verdict.found
    if found.is_identified:
        return Answer("slack", verdict.width, verdict.text)
    if found.is_aligned:
        limit = f"at most {found.width.high:.3g} {verdict.record.units[1]}"
        return Answer("no slack", limit, verdict.text)
    missing = found.missing.partition(" (95 %")[0].removeprefix("it is ")
    return Answer("unknown", missing.replace(LAG, "or a lag"), verdict.text)


def table(found: dict[str, Answer]) -> str:
    """Markdown: the records of each verdict, with judgements that are not simply right."""
    lines = []
    for says in SAYS:
        cells = []
        for name, each in found.items():
            said, judgement = JUDGEMENTS.get(name, ("", ""))
            text = f" ({judgement})" if judgement.startswith(OBJECTIONS) else ""
            text = text if said == each.says else " (**to be read**: the verdict has changed)"
            if each.says == says:
                cells.append(f"{name}: {each.slack}{text}")
        if cells:
            lines.append(f"- **{says}**, {len(cells)}: {'; '.join(cells)}")
    return "\n".join(lines)
