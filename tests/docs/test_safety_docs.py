"""docs/safety.md names the test of every hazard, and contains the reactions of the source."""

import re

from common.paths import ROOT
from guarantees.goals import GOALS
from reactions.__main__ import table
from tautscope.loop.safety import DETECTORS, Reaction

PAGE = (ROOT / "docs" / "safety.md").read_text(encoding="utf-8")
HAZARDS = {"V": 17, "E": 8, "C": 10, "D": 6, "P": 5, "L": 4, "N": 5, "M": 2, "U": 1, "H": 2}
TEST = re.compile(r"`(\w+)::(\w+)`")
PROPERTIES = ROOT / "crates" / "core" / "tests" / "properties"
CAMPAIGN = ROOT / "tests" / "benchmarks" / "test_fault_reactions.py"


def test_every_hazard_names_a_test_or_states_that_there_is_none() -> None:
    rows = re.findall(r"^\| ([A-Z]\d+) \|.*\| (.*) \|$", PAGE, re.MULTILINE)
    hazards = [(name, cell) for name, cell in rows if name[0] in HAZARDS]
    assert [name for name, _ in hazards] == [
        f"{letter}{number}" for letter, count in HAZARDS.items() for number in range(1, count + 1)
    ]
    shown_by_faults = re.findall(
        r'^    "([A-Z]\d+)": \(', CAMPAIGN.read_text("utf-8"), re.MULTILINE
    )
    assert [name for name, cell in hazards if "faults" in cell.split(", ")] == shown_by_faults
    for name, cell in hazards:
        tests = TEST.findall(cell)
        assert tests or name in shown_by_faults or cell.startswith("not shown"), name
        for file, test in tests:
            files = [*(ROOT / "tests").rglob(f"{file}.py"), *PROPERTIES.rglob(f"{file}.rs")]
            texts = [each.read_text(encoding="utf-8") for each in files]
            assert any(re.search(rf"\b(?:def|fn) {test}\b", text) for text in texts), (name, test)


def test_reactions_are_those_of_the_source() -> None:
    reactions = table()
    assert f"<!-- reactions: begin -->\n{reactions}\n<!-- reactions: end -->" in PAGE
    rows = [line.split(" | ") for line in reactions.splitlines()[2:]]
    flags = [flag for row in rows for flag in row[0].removeprefix("| ").split(", ")]
    assert sorted(flags) == sorted(DETECTORS)
    named = {name for row in rows for name in re.findall(r"(\w+) \(", row[2])}
    assert named <= {str(reaction) for reaction in Reaction}


def test_every_goal_has_a_result_or_is_marked_as_not_measured() -> None:
    rows = re.findall(r"^\| (G\d+[b-f]?) \|(.*)\|$", PAGE, re.MULTILINE)
    assert [name for name, _ in rows] == [goal.name for goal in GOALS]
    for name, cells in rows:
        figure, runs, failures = (cell.strip() for cell in cells.split("|")[2:5])
        is_count = re.fullmatch(r"0|[1-9]\d*, missed", failures)
        assert figure == "not measured" or (runs and is_count), name
