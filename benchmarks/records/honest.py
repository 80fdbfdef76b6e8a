"""Verdicts on simulated records of known truth: right, silent, or confident and wrong."""

from collections.abc import Sequence
from dataclasses import dataclass

from records.simulated import UNDETERMINED, WITH_SLACK, WITHOUT_SLACK, simulate
from tautscope.analysis.verdict import judge

Job = tuple[str, int]
"""Kind, seed."""
FIRST_SEED = 2000
"""Tests use seeds below 100, and rules were chosen on 1000 to 1039."""
KINDS = (*WITH_SLACK, *WITHOUT_SLACK, *UNDETERMINED[:3])
ALL = 40 * len(KINDS)
"""Number of records: the kinds in turn."""
SAYS = "slack", "no slack", "unknown"
"""With settings; with none, as the tip follows; with none, as it cannot be known."""
LARGEST_ERROR = 0.1
"""Of an identified width, as a share of the true one."""


@dataclass(frozen=True)
class Outcome:
    """What the verdict says of a record.

    Attributes:
        truth: True width; NaN if nothing determines it.
        width: Found, with its interval.
        says: One of `SAYS`.
    """

    truth: float
    width: tuple[float, float, float]
    says: str

    @property
    def is_right(self) -> bool:
        """No settings without slack, no slack only where there is none, no width that is wrong."""
        if self.says == "slack":
            return abs(self.width[0] - self.truth) <= LARGEST_ERROR * self.truth
        return self.says == "unknown" or self.truth == 0

    @property
    def is_held(self) -> bool:
        """Whether the interval holds the true width."""
        return self.width[1] <= self.truth <= self.width[2]


def jobs() -> list[Job]:
    """All records."""
    return [(KINDS[k % len(KINDS)], FIRST_SEED + k // len(KINDS)) for k in range(ALL)]


def evaluate(job: Job) -> Outcome:
    """Judge a record."""
    truth = simulate(*job)
    verdict = judge(truth.record)
    found = verdict.found
    assert (verdict.settings is not None) == found.is_identified
    says = "slack" if found.is_identified else "no slack" if found.is_aligned else "unknown"
    width = found.width.value, found.width.low, found.width.high
    return Outcome(truth.width, width, says)


def table(found: dict[Job, Outcome]) -> str:
    """Markdown: a row per kind."""
    every = list(found.items())
    lines = [
        f"All {len(every)} records, seeds {every[0][0][1]} to {every[-1][0][1]}:",
        "",
        "| kind | right | slack | no slack | unknown | interval holds the width, if identified |",
        "|---|--:|--:|--:|--:|--:|",
    ]
    for kind in (*KINDS, "all"):
        own = [each for (name, _), each in every if kind in (name, "all")]
        said = " | ".join(str(sum(each.says == says for each in own)) for says in SAYS)
        right = sum(each.is_right for each in own)
        held = _held([each for each in own if each.says == "slack"])
        lines.append(f"| {kind} | {right} of {len(own)} | {said} | {held} |")
    determined = [each for _, each in every if each.truth >= 0]
    lines += ["", f"The interval holds the width, identified or not: {_held(determined)}."]
    return "\n".join(lines)


def _held(own: Sequence[Outcome]) -> str:
    if not own:
        return ""
    held = sum(each.is_held for each in own)
    return f"{held} of {len(own)} ({held / len(own):.0%})"
