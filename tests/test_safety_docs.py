"""docs/safety.md names every hazard with its test, and has the reactions of the source."""

import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import guarantees
import reactions
from tautscope.loop.safety import DETECTORS, Reaction

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "safety.md").read_text(encoding="utf-8")
HAZARDS = {"V": 17, "E": 7, "C": 9, "D": 6, "P": 5, "L": 4}
TEST = re.compile(r"`([\w./-]+\.(?:py|rs))::(\w+)`")


def test_every_hazard_has_its_test_or_says_that_it_has_none() -> None:
    rows = re.findall(r"^\| ([A-Z]\d+) \|.*\| (.*) \|$", PAGE, re.MULTILINE)
    hazards = [(name, cell) for name, cell in rows if name[0] in HAZARDS]
    assert [name for name, _ in hazards] == [
        f"{letter}{number}" for letter, count in HAZARDS.items() for number in range(1, count + 1)
    ]
    for name, cell in hazards:
        tests = TEST.findall(cell)
        assert tests or cell.startswith("not shown"), name
        for file, test in tests:
            text = (ROOT / file).read_text(encoding="utf-8")
            assert re.search(rf"\b(?:def|fn) {test}\b", text), (name, file, test)


def test_the_reactions_are_those_of_the_source() -> None:
    table = reactions.table()
    assert f"<!-- reactions: begin -->\n{table}\n<!-- reactions: end -->" in PAGE
    rows = [line.split(" | ") for line in table.splitlines()[2:]]
    assert [row[0].removeprefix("| ") for row in rows] == list(DETECTORS)
    named = {name for row in rows for name in re.findall(r"(\w+) \(", row[2])}
    assert named <= {str(reaction) for reaction in Reaction}


def test_every_goal_has_a_row_that_was_measured_or_says_that_it_was_not() -> None:
    rows = re.findall(r"^\| (G\d+[b-d]?) \|(.*)\|$", PAGE, re.MULTILINE)
    assert [name for name, _ in rows] == [goal.name for goal in guarantees.GOALS]
    for name, cells in rows:
        figure, runs, failures = (cell.strip() for cell in cells.split("|")[2:5])
        said = re.fullmatch(r"0|[1-9]\d*, missed", failures)
        assert figure == "not measured" or (runs and said), name
