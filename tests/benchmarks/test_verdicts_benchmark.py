"""Verdicts on simulated and real records: what counts as right, and that all have been read."""

from collections import Counter

import numpy as np
import pytest
from common.paths import ROOT
from records import honest, verdicts
from records.honest import Outcome


@pytest.mark.parametrize(
    ("truth", "found", "says", "is_right"),
    [
        (4.0, 4.39, "slack", True),
        (4.0, 4.41, "slack", False),
        (4.0, 0.0, "no slack", False),
        (4.0, 9.0, "unknown", True),
        (0.0, 0.1, "slack", False),
        (0.0, 0.1, "no slack", True),
        (np.nan, 4.0, "slack", False),
        (np.nan, 0.0, "no slack", False),
        (np.nan, 4.0, "unknown", True),
    ],
)
def test_confidence_is_right_only_where_it_is_due(
    truth: float, found: float, says: str, is_right: bool
) -> None:
    assert Outcome(truth, (found, found - 1, found + 1), says).is_right == is_right


def test_the_table_counts_what_is_wrong() -> None:
    outcomes = {job: Outcome(4.0, (4.0, 3.9, 4.1), "slack") for job in honest.jobs()}
    first = next(iter(outcomes))
    outcomes[first] = Outcome(4.0, (5.0, 4.9, 5.1), "slack")
    text = honest.table(outcomes)
    assert f"| all | {len(outcomes) - 1} of {len(outcomes)} | {len(outcomes)} | 0 | 0 |" in text
    assert f"not: {len(outcomes) - 1} of {len(outcomes)} (100%)" in text
    kinds = Counter(kind for kind, _ in outcomes)
    assert set(kinds.values()) == {40} and len(kinds) == 12
    assert min(seed for _, seed in outcomes) > 1039


def test_records_of_each_sort_are_judged() -> None:
    assert honest.evaluate(("wrapped counter", 3)).truth > 0
    outcome = honest.evaluate(("linear", 3))
    assert (outcome.says, outcome.is_right, outcome.is_held) == ("no slack", True, True)


def test_the_page_has_a_judgement_of_every_real_record() -> None:
    page = (ROOT / "docs" / "verdicts.md").read_text(encoding="utf-8")
    if verdicts.names():
        assert set(verdicts.JUDGEMENTS) == set(verdicts.names())
    for name, (says, judgement) in verdicts.JUDGEMENTS.items():
        assert says in honest.SAYS
        (line,) = [line for line in page.splitlines() if line.startswith(f"- **{says}**, ")]
        (entry,) = [one for one in line.split("; ") if f"{name}: " in one]
        assert judgement.startswith(verdicts.OBJECTIONS) == (f"({judgement})" in entry)
    assert "to be read" not in page


def test_a_changed_verdict_is_to_be_read_again() -> None:
    name, (says, judgement) = next(
        item for item in verdicts.JUDGEMENTS.items() if item[1][1].startswith(verdicts.OBJECTIONS)
    )
    for now in honest.SAYS:
        text = verdicts.table({name: verdicts.Answer(now, "", "")})
        assert (judgement in text) == (now == says)
        assert ("to be read" in text) == (now != says)
