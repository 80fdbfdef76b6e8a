"""Documentation: names exist, links resolve, code and commands run."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import tautscope
from common.paths import ROOT
from tautscope.cli import _parser

PAGES = sorted(
    [
        *ROOT.glob("*.md"),
        *(ROOT / "docs").rglob("*.md"),
        *(ROOT / "rigs").rglob("*.md"),
        ROOT / "paper" / "paper.md",
    ]
)
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAPER = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")

REFERENCE = re.compile(r"`([\w./-]+\.(?:py|rs))::(\w+)`")
"""`file::name`, the file from the repository's root."""
FOLDERS = ("benchmarks", "configs", "crates", "docs", "examples", "python", "rigs", "ros", "tests")
TREE_PATH = re.compile(rf"`((?:{'|'.join(FOLDERS)})/[\w./-]+)(?:::\w+)?`")
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)\s]*)?\)")

pages = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())


def defined(file: str, name: str) -> bool:
    text = (ROOT / file).read_text(encoding="utf-8")
    return re.search(rf"\b(?:fn|struct|enum|def|class) {name}\b", text) is not None


def rows(text: str) -> list[list[str]]:
    """The cells of every table row that names an equation, a figure or a table."""
    lines = [line for line in text.splitlines() if re.match(r"\| (\(|Fig\.|Table)", line)]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def commands(text: str) -> list[str]:
    """Every `uv run ...` in a code span or block, without a redirection to a file."""
    found = re.findall(r"uv run ([^`\n>]+)", text)
    return sorted({command.strip() for command in found})


@pages
def test_names_in_a_page_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for file, name in REFERENCE.findall(text):
        assert (ROOT / file).is_file(), file
        assert defined(file, name), f"{file}::{name}"
    for path in TREE_PATH.findall(text):
        assert (ROOT / path).exists(), path


@pages
def test_links_inside_the_repository_resolve(page: Path) -> None:
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if not target.startswith(("http://", "https://")):
            assert (page.parent / target).exists(), target


@pages
def test_commands_in_a_page_are_valid(page: Path) -> None:
    for command in commands(page.read_text(encoding="utf-8")):
        tool, *arguments = shlex.split(command, comments=True)
        if tool == "--project":  # beside a clone
            tool, *arguments = [word.removeprefix("tautscope/") for word in arguments[1:]]
        if tool == "tautscope":
            if "--help" not in arguments:
                _parser().parse_args(arguments)
        elif tool.endswith(".py") or tool == "python":
            target = ROOT / (arguments[0] if tool == "python" else tool)
            assert target.is_file() or (target / "__main__.py").is_file(), command
        else:
            assert tool in {"pytest", "ruff", "mypy", "stubtest", "lint-imports"}, command


def test_every_equation_figure_and_table_has_a_function_and_a_test() -> None:
    covered: set[str] = set()
    for first, _, function, test, _ in rows(PAPER):
        assert REFERENCE.search(function), first
        for file, name in REFERENCE.findall(test):
            text = (ROOT / file).read_text(encoding="utf-8")
            where = text.index(f" {name}(")
            assert "test_" in name or "#[test]" in text[:where] or "proptest!" in text[:where], name
        assert REFERENCE.search(test), first
        kind = "" if first.startswith("(") else first.split()[0]
        ends = [int(number) for number in re.findall(r"\d+", first)]
        covered |= {f"{kind}{number}" for number in range(ends[0], ends[-1] + 1)}
    expected = {f"{n}" for n in range(1, 17)} | {f"Fig.{n}" for n in range(1, 10)} | {"Table1"}
    assert covered == expected


def test_the_readme_has_the_two_commands() -> None:
    blocks = re.findall(r"```sh\n(.*?)```", README, re.DOTALL)
    assert blocks[0].strip() == "python3 -m pip install uv && uv run tautscope demo"
    assert blocks[1].strip() == "uv run pytest"


def test_the_readmes_loop_estimates_the_backlash() -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len([line for line in code.splitlines() if line]) <= 15
    found = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False
    )
    assert found.returncode == 0, found.stderr
    width = float(found.stdout.split()[-1])
    assert width == pytest.approx(10, rel=0.25), "the twin's insertion has about 10 mm"


def test_the_citation_has_this_version() -> None:
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(rf"^version: {re.escape(tautscope.__version__)}$", text, re.MULTILINE)
