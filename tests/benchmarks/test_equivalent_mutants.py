"""Mutants that the results of mutation testing leave out are of lines and functions that exist."""

import re
import tomllib

from common.paths import ROOT
from guarantees.mutants import EQUIVALENT


def test_an_explained_mutant_is_of_a_line_of_the_source() -> None:
    mutants = tomllib.loads(EQUIVALENT.read_text("utf-8"))["mutant"]
    assert len(mutants) > 5
    for mutant in mutants:
        source = ROOT / mutant["name"].partition(":")[0]
        before, line, _ = source.read_text("utf-8").partition(f" {mutant['line']}\n")
        assert line, mutant["name"]
        function = re.findall(r"\bfn (\w+)", before)[-1]
        assert function == re.findall(r"\w+", mutant["name"])[-1], mutant["name"]
        assert mutant["reason"]
