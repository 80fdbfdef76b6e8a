"""The command as a person or a script meets it."""

import json
from functools import partial
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from drawn import BadFrameRig, DrawnRig, short_experiment
from play_model import play
from tautscope import demo
from tautscope.cli import main
from tautscope.config import dump_config, load_config
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
    arguments += ["--profile", "paper"]
    assert main([*arguments, "--out", str(out)]) == 0
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
    assert main(["demo", "--config", config_file, "--out", str(tmp_path / "run")]) == 0
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


def test_analyze_finds_the_offsets_of_a_play(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file, out = tmp_path / "log.csv", tmp_path / "found"
    write_record(file)
    columns = ["--command", "motor", "--measured", "tip", "--time", "t"]
    assert main(["analyze", str(file), *columns, "--out", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["samples"] == 2999
    assert found["dropped"] == 1
    assert found["update_distance"] == pytest.approx(0.3, rel=1e-3)
    assert found["delta_minus"] == pytest.approx(-3.0, abs=0.3)
    assert found["delta_plus"] == pytest.approx(5.0, abs=0.3)
    assert found["width"] == pytest.approx(found["delta_plus"] - found["delta_minus"])
    assert found["rmse"] < 0.1 * found["rmse_constant"] <= 0.1 * found["rmse_no_model"]
    assert {path.name for path in out.iterdir()} == {"analysis.csv", "analyze.png"}
    samples = np.genfromtxt(out / "analysis.csv", delimiter=",", names=True)
    assert len(samples) == 2999
    assert samples["line"][7] == 10  # the header is line 1, and line 9 was left out

    again = [*columns, "--update-distance", "0.5", "--out", str(tmp_path / "table")]
    assert main(["analyze", str(file), *again]) == 0
    text = capsys.readouterr().out
    assert "2999 (1 lines left out)" in text
    assert "backlash width" in text


def test_analyze_says_when_units_differ(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("c,m\n" + "".join(f"{c},{c * 1000}\n" for c in range(50)))
    arguments = ["--command", "c", "--measured", "m", "--out", str(tmp_path / "out")]
    assert main(["analyze", str(file), *arguments]) == 0
    assert "moves 1e+03 per unit of command" in capsys.readouterr().out


def test_analyze_names_what_it_cannot_use(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "log.csv"
    file.write_text("c,m\n1,2\n1,oops\n")
    arguments = ["analyze", str(file), "--command", "c", "--measured"]
    out = ["--out", str(tmp_path / "out")]
    assert "line 3, column m: got 'oops'" in failed(capsys, *arguments, "m", *out)
    assert "m2: got 'no such column', expected one of c" in failed(capsys, *arguments, "m2", *out)
    file.write_text("c,m\n1,2\n1,3\n")
    assert "command: got '1 throughout'" in failed(capsys, *arguments, "m", *out)
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]
