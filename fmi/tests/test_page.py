"""The master of docs/interfaces/fmi.md runs as it is written, and the page names what there is."""

import re
import shutil
from pathlib import Path

import build
import pytest
from conftest import Builder
from tautscope import Config, axes

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "interfaces" / "fmi.md").read_text(encoding="utf-8")


def test_the_code_of_the_page_runs(
    builder: Builder,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for kind in ("twin", "loop"):
        shutil.copy(builder(kind, Config()), tmp_path / f"tautscope_{kind}.fmu")
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    exec(compile(code, "fmi.md", "exec"), {})
    (last,) = capsys.readouterr().out.splitlines()
    reference, tip = (float(value) for value in re.findall(r"(0\.\d+) m", last))
    assert abs(reference - tip) < 10e-3
    assert abs(tip - 0.025) > 1e-3, "the tip did not move"


@pytest.mark.parametrize("kind", ["twin", "loop"])
def test_every_variable_is_on_the_page(kind: str) -> None:
    variables = build.variables_of(kind, Config())[1:]
    if kind == "loop":
        variables += build.variables_of(kind, axes(2, width_limit=1.2))[1:]
    for variable in variables:
        name = re.sub(r"_(insertion|rotation|bending|[ab]_[xy]|axis_\d)$", "_*", variable.name)
        assert f"`{name}`" in PAGE, name
