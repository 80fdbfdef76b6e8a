"""The command line: output, run folders, messages, exit status."""

import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from drawn import (
    make_bad_frame_rig,
    make_drawn_rig,
    make_stalling_rig,
    short_experiment,
    with_periods,
)
from refused import failed
from tautscope import figure_style
from tautscope.cli import main
from tautscope.config import dump_config, load_config
from tautscope.report import demo, film
from tautscope.report.operator_motion import operator_motion
from tautscope.report.results import ROWS
from tautscope.runs.recording import Recording, per_dof

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


OPERATOR_DURATION = 20.0
OPERATOR_FIGURES = [
    "uncompensated_rms",
    "compensated_rms",
    "reduction",
    "largest",
    "overspeed",
    "creep",
    "bound",
    "slack",
]


@pytest.fixture
def on_drawn_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(demo, "run_demo", partial(demo.run_demo, make_rig=make_drawn_rig))
    monkeypatch.setattr(film, "SECONDS", 1.0)
    monkeypatch.setattr(film, "EVALUATED_AFTER", 0.0)
    monkeypatch.setitem(figure_style._STYLE, "savefig.dpi", 120)
    monkeypatch.setattr(
        demo,
        "operator_motion",
        lambda config: replace(operator_motion(config), duration=OPERATOR_DURATION),
    )


@pytest.fixture
def config_file(tmp_path: Path) -> str:
    file = tmp_path / "short.toml"
    file.write_text(dump_config(with_periods(short_experiment(), 2.5)), encoding="utf-8")
    return str(file)


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
def test_demo_writes_a_run_folder_and_prints_one_json_object(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, config_file: str
) -> None:
    out = tmp_path / "run"
    arguments = ["demo", "--config", config_file, "--seed", "3", "--seeds", "2", "--json"]
    assert main([*arguments, "--profile", "paper", "--out", str(out)]) == 0
    captured = capsys.readouterr()
    assert "%" not in captured.err  # progress is for a terminal
    assert captured.out.count("\n") == 1
    found = json.loads(captured.out)
    assert list(found) == [
        "folder", "profile", "seeds", "dof", "hand", "sim_seconds", "wall_seconds",
    ]  # fmt: skip
    assert found["folder"] == str(out)
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
    assert found["sim_seconds"] == pytest.approx(4 * (3 * 3 * 2.5 + OPERATOR_DURATION), abs=0.1)

    assert list(found["hand"]) == list(found["dof"])
    for dof in found["hand"].values():
        assert list(dof) == OPERATOR_FIGURES
    operator = found["hand"]["insertion"]
    assert 1e-3 < operator["uncompensated_rms"] < 5e-3  # m, half of this rig's width at most
    assert operator["compensated_rms"] < 0.5 * operator["uncompensated_rms"]

    assert {path.name for path in out.iterdir()} == {
        "config.toml",
        "table1.csv",
        "operator_motion.csv",
        "operator_motion.png",
        "operator_motion.pdf",
        "film.gif",
        *(
            f"{name}{motion}{run}.{end}"
            for name, end in (("trace", "csv"), ("frames", "csv"), ("recording", "toml"))
            for motion in ("", "_operator_motion")
            for run in ("", "_uncompensated")
        ),
        "fig5.png",
        "fig9.png",
        "fig9.pdf",
        "report.html",
    }
    assert load_config(out / "config.toml").twin.seed == 3
    assert Recording.load(out).compensated
    assert not Recording.load(out, "_uncompensated").compensated
    motion = Recording.load(out, "_operator_motion")
    assert motion.compensated
    assert len(motion.trace) == OPERATOR_DURATION / 0.01
    free = Recording.load(out, "_operator_motion_uncompensated")
    assert not free.compensated
    for name in ("reference", "command"):
        np.testing.assert_array_equal(per_dof(free.trace, name), per_dof(motion.trace, "reference"))
    for name in ("fig5.png", "fig9.png", "operator_motion.png"):
        image = matplotlib.image.imread(out / name)
        assert min(image.shape[:2]) > 600
        assert np.ptp(image) > 0
    assert (out / "fig9.pdf").read_bytes().startswith(b"%PDF")
    header, *lines = (out / "table1.csv").read_text().splitlines()
    assert header.split(",")[4:] == [row.name for row in ROWS]
    assert [line.split(",")[3] for line in lines[:5]] == [
        "article", "seed 3", "seed 4", "median", "worst",
    ]  # fmt: skip
    assert {line.split(",")[2] for line in lines} == {"", "paper"}
    assert lines[0].split(",")[4] == "10"
    header, *lines = (out / "operator_motion.csv").read_text().splitlines()
    assert header.split(",") == ["dof", "unit", "profile", "source", *OPERATOR_FIGURES]
    assert [line.split(",")[0] for line in lines[::4]] == list(found["hand"])
    assert [line.split(",")[3] for line in lines[:4]] == ["seed 3", "seed 4", "median", "worst"]
    assert float(lines[2].split(",")[4]) == pytest.approx(
        1e3 * operator["uncompensated_rms"], rel=1e-5
    )
    low, high = sorted(float(line.split(",")[6]) for line in lines[:2])
    assert float(lines[3].split(",")[6]) == low < high


@pytest.mark.usefixtures("on_drawn_rig", "undrawn")
def test_demo_ends_with_three_sentences_about_both_profiles_and_two_files(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, config_file: str
) -> None:
    arguments = ["demo", "--config", config_file, "--profile", "best"]
    assert main([*arguments, "--out", str(tmp_path / "run")]) == 0
    out = capsys.readouterr().out
    table = (tmp_path / "run" / "table1.csv").read_text().splitlines()
    assert {line.split(",")[2] for line in table[1:]} == {"", "paper", "best"}
    facts, sines, motion, film_line, report = out.splitlines()
    assert facts.endswith("(insertion, rotation, bending).")
    slack, left = sines.split("there remain")
    number = r"\S+ mm / \S+ rad / \S+ rad"
    assert len(re.findall(number, slack)) == 1
    assert re.findall(rf"{number} with profile (\w+)", left) == ["paper", "best"]
    assert re.search(r"less by \d+ % / \d+ % / \d+ %\.$", motion)
    assert film_line.endswith("film.gif")
    assert report.endswith("report.html")


def test_a_failed_run_leaves_no_folder(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    config_file: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(demo, "run_demo", partial(demo.run_demo, make_rig=make_bad_frame_rig))
    out = tmp_path / "run"
    assert main(["demo", "--config", config_file, "--out", str(out)]) == 2
    assert "\nerror: " in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["short.toml"]


def test_a_run_in_which_motion_is_held_keeps_what_was_recorded(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    config_file: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(demo, "run_demo", partial(demo.run_demo, make_rig=make_stalling_rig))
    out = tmp_path / "run"
    assert main(["demo", "--config", config_file, "--out", str(out)]) == 4
    message = capsys.readouterr().err
    assert "error: Motion stopped at 1.510 s (hold_motion: late_tick" in message
    assert f"What was recorded until then: {out}" in message
    (trace,) = out.glob("trace*.csv")
    lines = trace.read_text(encoding="utf-8").splitlines()
    assert float(lines[-1].split(",")[0]) == pytest.approx(2.505, abs=0.011)


def test_demo_names_an_invalid_input(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    nowhere = str(tmp_path / "nowhere")
    assert f"Folder not found: {nowhere}" in failed(capsys, "demo", "--background", nowhere)
    assert f"File not found: {nowhere}" in failed(capsys, "demo", "--config", nowhere)
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
        (
            ["analyze", "a.csv", "--command", "c", "--measured", "m", "--gain", "1e160"],
            "got '1e160', expected a number other than 0, of a magnitude of 1e-100 to 1e100",
        ),
        (["fly"], "invalid choice: 'fly'"),
        ([], "COMMAND"),
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


@pytest.mark.parametrize(
    "verb",
    [
        "", "demo", "config", "analyze", "recover", "export", "replay", "run", "bench", "doctor",
        "calibrate", "jog",
    ],
)  # fmt: skip
def test_every_verb_has_help(capsys: pytest.CaptureFixture[str], verb: str) -> None:
    with pytest.raises(SystemExit) as stop:
        main([verb, "--help"] if verb else ["--help"])
    assert stop.value.code == 0
    assert "usage: tautscope" in capsys.readouterr().out


@pytest.mark.parametrize("verb", ["demo", "console", "doctor", "ros2"])
def test_commands_for_the_articles_instrument_refuse_another_robot(
    verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text('[[dof]]\nname = "bend_x"\nwidth_limit = 1.0\n', encoding="utf-8")
    assert main([verb, "--config", str(file)]) == 2
    assert "dof: got 'bend_x'" in capsys.readouterr().err
