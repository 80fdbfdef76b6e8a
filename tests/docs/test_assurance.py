"""The pages for whoever assesses risks: hazards, software of others, known anomalies."""

import re

import assurance
from common.paths import ROOT

DOCS = ROOT / "docs"
SAFETY = (DOCS / "safety.md").read_text(encoding="utf-8")


def test_the_files_of_the_hazards_are_up_to_date() -> None:
    assert assurance.with_controls(SAFETY) == SAFETY, "run `uv run docs/assurance.py`"


def test_the_list_of_software_is_up_to_date() -> None:
    page = (DOCS / "soup.md").read_text(encoding="utf-8")
    assert page == assurance.soup(), "run `uv run docs/assurance.py`"
    assert "| numpy | " in page


def test_every_hazard_has_a_control_in_a_file() -> None:
    found = list(assurance.hazards(SAFETY))
    table = SAFETY.partition("## Hazards")[2].partition("<!-- controls: begin -->")[0]
    assert len(found) == len(re.findall(r"^\| [VECDPLNMUH]\d+ \|", table, re.MULTILINE)) > 40
    for name, response in found:
        files = assurance.control_files(name, response)
        assert files, f"{name}: no file implements its control"
        for file in files:
            assert (ROOT / file).is_file(), (name, file)
    assert set(assurance.CONTROLS) <= {name for name, _ in found}


def test_a_flag_is_traced_to_the_files_that_raise_it() -> None:
    for file in assurance.control_files("none", "`frozen`: holds the estimate"):
        assert "Flag::Frozen" in (ROOT / file).read_text(encoding="utf-8")
    assert assurance.control_files("none", "`no_such_flag`") == []


def test_every_missed_goal_is_a_known_anomaly() -> None:
    anomalies = (DOCS / "anomalies.md").read_text(encoding="utf-8")
    missed = re.findall(r"^\| (G\d+[b-f]?) \|.*, missed \|", SAFETY, re.MULTILINE)
    assert missed
    for goal in missed:
        assert re.search(rf"\b{goal}\b", anomalies), goal
