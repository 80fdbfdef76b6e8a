"""The C and C++ code of docs/interfaces.md is what `.ci/cpp` compiles and runs."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.parametrize(("language", "file"), [("c", "first_steps.c"), ("cpp", "first_steps.cpp")])
def test_the_code_of_the_page_is_that_of_the_example(language: str, file: str) -> None:
    page = (ROOT / "docs" / "interfaces.md").read_text(encoding="utf-8")
    (code,) = re.findall(rf"```{language}\n(.*?)```", page, re.DOTALL)
    assert code == (ROOT / "examples" / "cpp" / file).read_text(encoding="utf-8")
