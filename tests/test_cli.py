"""The command as a person or a script meets it."""

import json
import math
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from drawn import BadFrameRig, DrawnRig, short_experiment
from play_model import play
from tautscope import demo
from tautscope.cli import main
from tautscope.config import dump_config, load_config
from tautscope.models.registry import MODELS
from tautscope.recording import Recording
from tautscope.tables import ROWS

SUMMARY = [
    "unit",
    "uncompensated",
    "compensated",
    "reduction",
    "reduction_max",
    "start_periods",
    "tracking_rms",
    "state_rms",
    "marker_rms_px",
]


@pytest.fixture
def on_drawn_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo, "run_demo", partial(demo.run_demo, make_rig=DrawnRig))


@pytest.fixture
def config_file(tmp_path: Path) -> str:
    file = tmp_path / "short.toml"
    file.write_text(dump_config(short_experiment()), encoding="utf-8")
    return str(file)


def failed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The one line on stderr of a command that must fail."""
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    return err


def test_config_prints_what_load_config_reads(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["config"]) == 0
    file = tmp_path / "printed.toml"
    file.write_text(capsys.readouterr().out, encoding="utf-8")
    assert load_config(file) == load_config()
    file.write_text("[insertion]\nfree_gain = 2.0\n", encoding="utf-8")
    assert main(["config", "--config", str(file)]) == 0
    assert "free_gain = 2.0" in capsys.readouterr().out


@pytest.mark.usefixtures("on_drawn_rig")
def test_demo_fills_a_run_folder_and_prints_one_object(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, config_file: str
) -> None:
    out = tmp_path / "run"
    arguments = ["demo", "--config", config_file, "--seed", "3", "--seeds", "2", "--json"]
    assert main([*arguments, "--profile", "paper", "--out", str(out)]) == 0
    captured = capsys.readouterr()
    assert "4 runs: 100 %" in captured.err
    assert captured.out.count("\n") == 1
    found = json.loads(captured.out)
    assert list(found) == ["profile", "seeds", "dof", "sim_seconds", "wall_seconds"]
    assert found["profile"] == "paper"
    assert found["seeds"] == [3, 4]
    assert list(found["dof"]) == ["insertion", "rotation", "bending"]
    for dof in found["dof"].values():
        assert list(dof) == [*SUMMARY, "worst"]
    insertion = found["dof"]["insertion"]
    assert insertion["unit"] == "mm"
    assert 10 < insertion["uncompensated"] < 11
    assert 0.7 < insertion["reduction"] < 0.82
    assert insertion["marker_rms_px"] is None  # this rig has no true features
    assert found["sim_seconds"] == pytest.approx(4 * 36, abs=0.1)

    assert {path.name for path in out.iterdir()} == {
        "config.toml",
        "table1.csv",
        *(f"{name}{run}" for name in ("trace", "frames") for run in (".csv", "_uncompensated.csv")),
        "recording.toml",
        "recording_uncompensated.toml",
        "fig5.png",
        "fig9.png",
        "fig9.pdf",
        "report.html",
    }
    assert load_config(out / "config.toml").twin.seed == 3
    assert Recording.load(out).compensated
    assert not Recording.load(out, "_uncompensated").compensated
    for name in ("fig5.png", "fig9.png"):
        picture = matplotlib.image.imread(out / name)
        assert min(picture.shape[:2]) > 600
        assert np.ptp(picture) > 0
    assert (out / "fig9.pdf").read_bytes().startswith(b"%PDF")
    header, *lines = (out / "table1.csv").read_text().splitlines()
    assert header.split(",")[3:] == [row.name for row in ROWS]
    assert [line.split(",")[2] for line in lines[:5]] == [
        "article", "seed 3", "seed 4", "median", "worst",
    ]  # fmt: skip
    assert lines[0].split(",")[3] == "10"


@pytest.mark.usefixtures("on_drawn_rig")
def test_demo_prints_the_article_beside_ours(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, config_file: str
) -> None:
    arguments = ["demo", "--config", config_file]
    assert main([*arguments, "--out", str(tmp_path / "run")]) == 0
    out = capsys.readouterr().out
    assert next(line.split() for line in out.splitlines() if "article" in line and "paper" in line)[
        :3
    ] == ["article", "paper", "best"]
    reduction = next(line for line in out.splitlines() if line.startswith("reduction "))
    assert [cell for cell in reduction.split("  ") if cell.strip()][1].strip() == "75 %"
    assert "rotation [rad]" in out
    assert "report.html" in out


def test_a_run_that_fails_leaves_nothing(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    config_file: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(demo, "run_demo", partial(demo.run_demo, make_rig=BadFrameRig))
    out = tmp_path / "run"
    assert main(["demo", "--config", config_file, "--out", str(out)]) == 2
    assert "error: " in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["short.toml"]


def test_demo_names_what_it_cannot_use(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    nowhere = str(tmp_path / "nowhere")
    assert "twin.background: got" in failed(capsys, "demo", "--background", nowhere)
    assert "config: got" in failed(capsys, "demo", "--config", nowhere)
    (tmp_path / "notes.txt").write_text("mine")
    err = failed(capsys, "demo", "--out", str(tmp_path))
    assert f"out: got '{tmp_path}', expected a folder that is empty" in err
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["demo", "--profile", "papre"], "invalid choice: 'papre'"),
        (["demo", "--seed", "-1"], "got '-1', expected an integer of at least 0"),
        (["demo", "--seeds", "0"], "got '0', expected an integer of at least 1"),
        (["demo", "--seeds", "two"], "got 'two'"),
        (["analyze", "a.csv", "--command", "c"], "--measured"),
        (
            ["analyze", "a.csv", "--command", "c", "--measured", "m", "--update-distance", "nan"],
            "got 'nan', expected a number above 0",
        ),
        (
            ["analyze", "a.csv", "--command", "c", "--measured", "m", "--gain", "0"],
            "got '0', expected a number other than 0",
        ),
        (["fly"], "invalid choice: 'fly'"),
        ([], "VERB"),
    ],
    ids=lambda value: " ".join(value) or "nothing" if isinstance(value, list) else "",
)
def test_a_bad_argument_is_named(
    capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize("verb", ["", "demo", "config", "analyze"])
def test_every_verb_has_help(capsys: pytest.CaptureFixture[str], verb: str) -> None:
    with pytest.raises(SystemExit) as stop:
        main([verb, "--help"] if verb else ["--help"])
    assert stop.value.code == 0
    assert "usage: tautscope" in capsys.readouterr().out


def write_record(file: Path) -> None:
    rng = np.random.default_rng(0)
    time = np.arange(3000) * 0.02
    command = 15 * np.sin(2 * np.pi * time / 10)
    measured = play(command, -3.0, 5.0) + rng.normal(0, 0.05, len(time))
    lines = [f"{t:.3f},{c:.5f},{m:.5f}" for t, c, m in zip(time, command, measured, strict=True)]
    lines[7] = "0.14,,1.0"
    file.write_text("t,motor,tip\n" + "\n".join(lines) + "\n")


def analyzed(
    capsys: pytest.CaptureFixture[str], file: Path, out: Path, *more: str
) -> dict[str, Any]:
    columns = ["--command", "motor", "--measured", "tip", "--time", "t"]
    assert main(["analyze", str(file), *columns, *more, "--out", str(out), "--json"]) == 0
    document: dict[str, Any] = json.loads(capsys.readouterr().out)
    document["models"] = {model["name"]: model for model in document["models"]}
    return document


def test_analyze_finds_the_offsets_of_a_play(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file, out = tmp_path / "log.csv", tmp_path / "found"
    write_record(file)
    found = analyzed(capsys, file, out)
    assert found["samples"] == 2999
    assert found["scored"] == 1500
    assert found["cleaning"].pop("blank") == 1
    assert not any(found["cleaning"].values())
    paper = found["models"]["paper"]["parameters"]
    assert paper["update_distance"] == pytest.approx(0.3, rel=1e-2)
    for name in ("play", "paper"):
        parameters = found["models"][name]["parameters"]
        assert parameters["gain"] == pytest.approx(1, abs=0.01)
        assert parameters["delta_minus"] == pytest.approx(-3.0, abs=0.3)
        assert parameters["delta_plus"] == pytest.approx(5.0, abs=0.3)
        width = parameters["delta_plus"] - parameters["delta_minus"]
        assert parameters["width"] == pytest.approx(width)
    assert {path.name for path in out.iterdir()} == {"analysis.csv", "analyze.png"}
    samples = np.genfromtxt(out / "analysis.csv", delimiter=",", names=True)
    assert len(samples) == 2999
    assert samples["line"][7] == 10  # the header is line 1, and line 9 was left out
    for name, model in found["models"].items():
        late = (samples[name] - samples["measured"])[1499:]
        assert model["rmse"] == pytest.approx(np.sqrt(np.mean(late**2)), rel=1e-6), name
        share = model["rmse"] / found["models"]["none"]["rmse"]
        assert model["share_of_no_model"] == pytest.approx(share)
        assert name == "none" or share < 0.1


def test_analyze_prints_a_row_per_model(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    write_record(file)
    columns = ["--command", "motor", "--measured", "tip", "--update-distance", "0.5"]
    assert main(["analyze", str(file), *columns, "--out", str(tmp_path / "table")]) == 0
    text = capsys.readouterr().out
    for model in MODELS:
        assert f"\n{model.title} " in text
        assert model.learns in text
    assert "2999 samples, 1500 of them scored; lines without a command, left out: 1;" in text
    assert "not checked without --time" in text


def test_analyze_takes_a_gain(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    write_record(file)
    found = analyzed(capsys, file, tmp_path / "out", "--gain", "0.9")
    for name in ("none", "play", "paper"):
        assert found["models"][name]["parameters"]["gain"] == 0.9
    samples = np.genfromtxt(tmp_path / "out" / "analysis.csv", delimiter=",", names=True)
    assert np.isfinite(samples["paper"][1:]).all()


def test_a_messy_record_gives_what_the_clean_one_gives(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Motor steps, tip in metres from elsewhere, unevenly sampled, holes, copies, late lines."""
    clean, messy = tmp_path / "clean.csv", tmp_path / "messy.csv"
    write_record(clean)
    rng = np.random.default_rng(1)
    lines = []
    for text in clean.read_text().splitlines()[1:]:
        t, motor, tip = (float(cell) if cell else math.nan for cell in text.split(","))
        if rng.uniform() < 0.1 and len(lines) > 5:
            continue
        lines.append(
            f"{t},{-500 * motor + 12000 if math.isfinite(motor) else ''},{tip / 1000 + 0.2!r}"
        )
    for at in rng.choice(len(lines) - 10, 40, replace=False):
        lines.insert(at, lines[at])
    for at in rng.choice(len(lines) - 10, 40, replace=False):
        lines.insert(at + 3, lines.pop(at))
    del lines[1200:1260]
    messy.write_text("t,motor,tip\n" + "\n".join(lines) + "\n")
    plain = analyzed(capsys, clean, tmp_path / "a")["models"]
    found = analyzed(capsys, messy, tmp_path / "b")
    assert found["cleaning"]["duplicates"] >= 38
    assert found["cleaning"]["reordered"] >= 30
    assert found["cleaning"]["gaps"] == 1
    for name, model in found["models"].items():
        assert 1000 * model["rmse"] == pytest.approx(plain[name]["rmse"], rel=0.1, abs=0.01), name
    for name in ("play", "paper"):
        parameters = found["models"][name]["parameters"]
        assert parameters["gain"] == pytest.approx(-1 / 500_000, rel=0.01)
        assert 1000 * parameters["width"] == pytest.approx(8, abs=0.3)


def test_analyze_names_what_it_cannot_use(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "log.csv"
    file.write_text("c,m\n1,2\n1,oops\n")
    arguments = ["analyze", str(file), "--command", "c", "--measured"]
    out = ["--out", str(tmp_path / "out")]
    assert "line 3, column m: got 'oops'" in failed(capsys, *arguments, "m", *out)
    assert "m2: got 'no such column', expected one; the header has c" in failed(
        capsys, *arguments, "m2", *out
    )
    file.write_text("c,m\n1,2\n1,3\n")
    assert "command: got '1 throughout the first half'" in failed(capsys, *arguments, "m", *out)
    file.write_text("c,m\n" + "".join(f"{c},7\n" for c in range(9)))
    assert "measured: got '7 throughout the first half'" in failed(capsys, *arguments, "m", *out)
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]
