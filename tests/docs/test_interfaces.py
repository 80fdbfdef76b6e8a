"""The code of the pages for other programs is run, here or by `.ci/cpp`."""

import itertools
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from common.paths import ROOT
from drawn import DrawnRig, short_experiment
from tautscope.config import dump_config

PAGES = ROOT / "docs" / "interfaces"
EXAMPLES = PAGES.parents[1] / "examples"


def blocks(page: str, language: str) -> list[str]:
    text = (PAGES / page).read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


@pytest.mark.parametrize(("language", "file"), [("c", "first_steps.c"), ("cpp", "robot.cpp")])
def test_the_code_of_the_page_is_that_of_the_examples(language: str, file: str) -> None:
    code = (EXAMPLES / "cpp" / file).read_text(encoding="utf-8")
    found = blocks("cpp.md", language)
    assert found
    assert [block for block in found if block not in code] == []


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "rig.toml").write_text(dump_config(short_experiment()), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("folder")
def test_the_code_for_python_runs(capsys: pytest.CaptureFixture[str]) -> None:
    ticks = itertools.count(1)
    names: dict[str, Any] = {
        "image": np.zeros((576, 720, 3), np.uint8),
        "loop_time": lambda: 0.005 * next(ticks),
    }
    for code in blocks("python.md", "python"):
        exec(code, names)
    assert names["loop"].updates == 2
    assert "lost" in capsys.readouterr().out, "the image is black"
    assert np.isfinite(names["command"]).all()
    assert (names["slack"] >= 0).all()


def test_the_code_for_input_devices_runs(folder: Path) -> None:
    config = short_experiment()
    rows = [f"{0.1 * k},{25 + k},{0.01 * k},0.9" for k in range(10)]
    text = "\n".join(["time,insertion_mm,rotation,bending", *rows])
    (folder / "motion.csv").write_text(text, encoding="utf-8")
    recorded, dated = blocks("devices.md", "python")
    names: dict[str, Any] = {"rig": DrawnRig(config), "config": config}
    exec(recorded, names)
    reached = names["recording"].trace["reference_insertion"][-1]
    assert reached == pytest.approx(34e-3, abs=1e-3)
    calls: list[dict[str, Any]] = []
    names = {
        "device": SimpleNamespace(read=lambda: ([0.0, 0.0, 0.0], 1.0)),
        "loop": SimpleNamespace(step=lambda reference, **times: calls.append(times)),
        "now": 1.5,
    }
    exec(dated, names)
    assert calls == [{"time": 1.5, "made_at": 1.0}]
