"""docs/interfaces/matlab.md: its code is what `.ci/matlab` runs, its tables name what there is."""

import re

from common.paths import ROOT

PAGE = (ROOT / "docs" / "interfaces" / "matlab.md").read_text(encoding="utf-8")


def test_the_code_of_the_page_is_that_of_the_example() -> None:
    (code,) = re.findall(r"```matlab\n(.*?)```", PAGE, re.DOTALL)
    assert code == (ROOT / "matlab" / "examples" / "first_steps.m").read_text(encoding="utf-8")


def test_every_method_of_the_class_is_on_the_page() -> None:
    source = (ROOT / "matlab" / "+tautscope" / "Loop.m").read_text(encoding="utf-8")
    source = source.partition("methods (Hidden)")[0]
    methods = re.findall(r"^        function (?:\w+ = )?(\w+)\(self", source, re.M)
    assert len(methods) == 13
    assert [name for name in methods if f"{name}(" not in PAGE] == []


def test_the_block_of_simulink_has_the_ports_of_the_page() -> None:
    source = (ROOT / "matlab" / "sfun_tautscope.c").read_text(encoding="utf-8")
    for kind, column in (("input", 0), ("output", 2)):
        (widths,) = re.findall(rf"{kind}_widths\[\w+\] = {{(.*?)}}", source)
        rows = re.findall(r"^\| (\d) \| (.*?) \| (\d?) ?\| (.*?) ?\|$", PAGE, re.M)
        numbers = [row[column] for row in rows if row[column]]
        assert numbers == [str(port) for port in range(1, widths.count(",") + 2)]
