"""Mutants that the results of mutation testing leave out are of lines that exist."""

import tomllib

from common.paths import ROOT
from guarantees.mutants import EQUIVALENT


def test_an_explained_mutant_is_of_a_line_of_the_source() -> None:
    mutants = tomllib.loads(EQUIVALENT.read_text("utf-8"))["mutant"]
    assert len(mutants) > 5
    for mutant in mutants:
        source = ROOT / mutant["name"].partition(":")[0]
        lines = {line.strip() for line in source.read_text("utf-8").splitlines()}
        assert mutant["line"] in lines, mutant["name"]
        assert mutant["reason"]
