"""Imports run one way: the layer contract of pyproject.toml, and no circle between files."""

import ast
import shutil
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from common.paths import ROOT

LINT = [Path(sys.executable).with_name("lint-imports"), "--no-cache"]


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The package's Python files, to plant a violation into."""
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    files = shutil.ignore_patterns("__pycache__", "*.so")
    return shutil.copytree(ROOT / "python" / "tautscope", tmp_path / "tautscope", ignore=files)


def imports(package: Path) -> dict[str, set[str]]:
    """The modules that each module imports anywhere, also in functions and for type checking."""
    files = {
        ".".join(file.relative_to(package.parent).with_suffix("").parts): file
        for file in [*package.rglob("*.py"), *package.rglob("*.pyi")]
    }
    files = {name.removesuffix(".__init__"): file for name, file in files.items()}
    graph: dict[str, set[str]] = {}
    for name, file in files.items():
        found = set()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{file}: relative import"
                names = [f"{node.module}.{alias.name}" for alias in node.names]
                found |= {each if each in files else str(node.module) for each in names}
        graph[name] = found & set(files)
    return graph


def test_no_files_import_each_other_in_a_circle() -> None:
    graph = imports(ROOT / "python" / "tautscope")
    assert "tautscope.loop.vision" in graph["tautscope.loop.reduction"]  # in a function
    TopologicalSorter(graph).prepare()


@pytest.mark.parametrize(
    "planted",
    [
        "from tautscope.loop.reduction import Report",
        "def f():\n    from tautscope.loop import reduction",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from tautscope import Report",
    ],
)
def test_a_planted_circle_is_found(copy: Path, planted: str) -> None:
    with (copy / "loop" / "vision.py").open("a", encoding="utf-8") as file:
        file.write(f"\n{planted}\n")
    with pytest.raises(CycleError):
        TopologicalSorter(imports(copy)).prepare()


@pytest.mark.parametrize(
    ("importer", "imported"),
    [
        ("loop/rig.py", "tautscope.runs.recording"),
        ("twin/camera.py", "tautscope.runs.output_folder"),
        ("log/journal.py", "tautscope.analysis.comparison"),
        ("runs/trials.py", "tautscope.rig"),
        (None, None),
    ],
)
def test_a_planted_violation_breaks_the_contract(
    copy: Path, importer: str | None, imported: str | None
) -> None:
    if importer is not None:
        with (copy / importer).open("a", encoding="utf-8") as file:
            file.write(f"\nimport {imported}\n")
    found = subprocess.run(LINT, cwd=copy.parent, capture_output=True, text=True, check=False)
    assert found.returncode == (importer is not None), found.stdout
    assert imported is None or f"{imported} (l." in found.stdout, found.stdout
