"""`tautscope analyze`: results, table, cleaning, messages."""

import json
import math
from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bag_files import START, joint_state, pose_stamped, write_bag
from play_model import play
from refused import failed
from tautscope import figure_style
from tautscope.analysis import output
from tautscope.analysis.comparison import HORIZONS
from tautscope.analysis.models import bouc_wen
from tautscope.analysis.models.registry import MODELS
from tautscope.cli import main

SAMPLES = 1600


@pytest.fixture(scope="module", autouse=True)
def _fast() -> Iterator[None]:
    """Coarse pictures, and one start of the slowest fit."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(figure_style._STYLE, "savefig.dpi", 20)
        patch.setattr(bouc_wen, "_STARTS", (15.0,))
        yield


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("record") / "log.csv"
    write_record(file)
    return file


@pytest.fixture(scope="module")
def found(record: Path) -> dict[str, Any]:
    return analyzed(record, record.parent / "found", "--check")


def write_record(file: Path) -> None:
    rng = np.random.default_rng(0)
    time = np.arange(SAMPLES) * 0.02
    command = 15 * np.sin(2 * np.pi * time / 10)
    measured = play(command, -3.0, 5.0) + rng.normal(0, 0.05, len(time))
    lines = [f"{t:.3f},{c:.5f},{m:.5f}" for t, c, m in zip(time, command, measured, strict=True)]
    lines[7] = "0.14,,1.0"
    file.write_text("t,motor,tip\n" + "\n".join(lines) + "\n")


def analyzed(file: Path, out: Path, *more: str) -> dict[str, Any]:
    columns = ["--command", "motor", "--measured", "tip", "--time", "t"]
    with redirect_stdout(StringIO()) as printed, redirect_stderr(StringIO()) as progress:
        assert main(["analyze", str(file), *columns, *more, "--out", str(out), "--json"]) == 0
    assert progress.getvalue() == ""  # which is for a terminal
    document: dict[str, Any] = json.loads(printed.getvalue())
    assert document["models"] == document["dofs"][0]["models"]
    document |= document["dofs"][0]
    document["models"] = {model["name"]: model for model in document["models"]}
    return document


def test_analyze_finds_the_offsets_of_a_play(found: dict[str, Any]) -> None:
    out = Path(found["folder"])
    assert found["samples"] == SAMPLES
    assert found["scored"] == SAMPLES // 2
    assert {what: count for what, count in found["cleaning"].items() if count} == {
        "interpolated": 1
    }
    paper = found["models"]["paper"]["parameters"]
    assert paper["update_distance"] == pytest.approx(0.3, rel=1e-2)
    for name in ("play", "paper"):
        parameters = found["models"][name]["parameters"]
        assert parameters["gain"] == pytest.approx(1, abs=0.01)
        assert parameters["delta_minus"] == pytest.approx(-3.0, abs=0.3)
        assert parameters["delta_plus"] == pytest.approx(5.0, abs=0.3)
        width = parameters["delta_plus"] - parameters["delta_minus"]
        assert parameters["width"] == pytest.approx(width)
    assert {path.name for path in out.iterdir()} == {
        "analysis.csv", "analyze.png", "models.png", "compensator.toml", "compensator.py",
    }  # fmt: skip
    samples = np.genfromtxt(out / "analysis.csv", delimiter=",", names=True)
    assert len(samples) == SAMPLES
    assert samples["line"][7] == 9
    for name, model in found["models"].items():
        late = (samples[name] - samples["measured"])[SAMPLES // 2 :]
        assert model["rmse"] == pytest.approx(np.sqrt(np.mean(late**2)), rel=1e-6), name
        share = model["rmse"] / found["models"]["none"]["rmse"]
        assert model["share_of_no_model"] == pytest.approx(share)
        assert name == "none" or share < 0.1


def test_files_have_nine_digits() -> None:
    rng = np.random.default_rng(11)
    values = rng.normal(size=5000) * 10.0 ** rng.integers(-20, 9, 5000)
    values[:3] = 0.0, np.nan, -1.0
    expected = [float(f"{value:.9g}") for value in values]
    np.testing.assert_allclose(output._rounded(values), expected, rtol=3e-16)


@pytest.mark.usefixtures("undrawn")
def test_analyze_prints_a_row_per_model(
    record: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "log.csv"
    file.write_text(record.read_text().replace("t,motor", "n,motor"))
    columns = ["--command", "motor", "--measured", "tip", "--update-distance", "0.5"]
    assert main(["analyze", str(file), *columns, "--out", str(tmp_path / "table")]) == 0
    text = capsys.readouterr().out
    for model in MODELS:
        assert f"\n{model.title} " in text
        assert model.fitted_to in text
    assert "1599 samples, 800 of them scored; lines without a command or time, removed: 1;" in text
    assert text.startswith("The slack is 8.0")
    assert "not checked without --time" in text


@pytest.mark.usefixtures("undrawn", "three_models")
def test_analyze_takes_a_gain(record: Path, tmp_path: Path) -> None:
    found = analyzed(record, tmp_path / "out", "--gain", "0.9")
    for name in ("none", "play", "paper"):
        assert found["models"][name]["parameters"]["gain"] == 0.9
    samples = np.genfromtxt(tmp_path / "out" / "analysis.csv", delimiter=",", names=True)
    assert np.isfinite(samples["paper"][1:]).all()


def test_a_verdict_comes_first_and_its_fields_are_in_the_document(found: dict[str, Any]) -> None:
    [dof] = found["dofs"]
    assert dof["identified"]
    assert dof["width"] == pytest.approx(8, rel=0.02)
    assert dof["interval"][0] < 8 < dof["interval"][1]
    assert dof["delay"] == pytest.approx(0, abs=0.01)
    assert dof["delay_unit"] == "s"
    assert dof["compensation"]["after"] < 0.3 * dof["compensation"]["before"]
    assert found["verdict"].startswith("The slack is 8.0")
    assert found["settings"] == dof["settings"] is not None
    width = found["settings"]["dof"][0]["expected_width"]
    assert width == pytest.approx(1e-3 * dof["width"], rel=1e-5)


@pytest.mark.usefixtures("undrawn", "three_models")
def test_a_pure_delay_gets_no_settings(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    time = np.arange(2000) * 0.02
    noise = np.random.default_rng(3).normal(0, 0.05, len(time))
    motor, tip = 15 * np.sin(time), 15 * np.sin(time - 0.2) + noise
    lines = [f"{a:.3f},{b:.5f},{c:.5f}\n" for a, b, c in zip(time, motor, tip, strict=True)]
    file.write_text("time,motor,tip\n" + "".join(lines))
    columns = ["analyze", str(file), "--command", "motor", "--measured", "tip", "--check"]
    assert main([*columns, "--json", "--out", str(tmp_path / "a")]) == 1
    found = json.loads(capsys.readouterr().out)
    [dof] = found["dofs"]
    assert (dof["identified"], dof["aligned"], dof["width"]) == (False, True, 0)
    assert dof["delay"] == pytest.approx(0.2, abs=0.005)
    assert found["settings"] is None
    assert main([*columns[:-1], "--out", str(tmp_path / "b")]) == 0
    text = capsys.readouterr().out
    assert "aligned by its delay of 0.19" in text or "delay of 0.20" in text
    assert "the slack is 0, at most" in text
    assert "width" not in text.split("\n\n")[1]
    assert "No settings for tip: the slack is not identified." in text
    assert not list(tmp_path.glob("*/compensator.*"))


def test_columns_are_listed_and_pairs_proposed(
    record: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["analyze", str(record), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [each["title"] for each in found["columns"]] == ["t", "motor", "tip"]
    assert found["columns"][0]["largest"] == 31.98
    assert found["pairs"] == [{"command": "motor", "measured": "tip"}]
    assert main(["analyze", str(record)]) == 0
    assert f"analyze {record} --command motor --measured tip" in capsys.readouterr().out


def test_a_column_that_is_not_listed_is_named_with_its_first_bad_cell(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "record.csv"
    file.write_text("motor,tip,state\n" + 9 * "1,2,\n" + "2,inf,\n")
    bad = f"{file}, line 11, column tip: got 'inf', expected a number"
    assert main(["analyze", str(file), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [each["title"] for each in found["columns"]] == ["motor"]
    assert found["left_out"][0].startswith(bad)
    assert found["left_out"][1] == f"{file}, column state: got 'no value', expected numbers"
    assert main(["analyze", str(file)]) == 0
    assert f"Left out: {bad}" in capsys.readouterr().out


def test_a_table_without_a_column_of_numbers_says_why(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "record.csv"
    file.write_text("motor,tip\n" + 9 * "1,2\n" + "motor,tip\n1,2\n")  # two records, one file
    assert main(["analyze", str(file)]) == 2
    assert f"{file}, line 11, column motor: got 'motor'" in capsys.readouterr().err
    file.write_text("motor,tip\n")
    assert "no column of numbers: no data" in failed(capsys, "analyze", str(file))


@pytest.mark.usefixtures("undrawn", "three_models")
def test_a_tip_of_its_own_file_and_rate(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Motor at 100 Hz, tip at 27 Hz that begins later, in ns since 1970."""
    motor, tip = tmp_path / "motor.csv", tmp_path / "tip.csv"
    time, seen = np.arange(0, 40, 0.01), np.arange(1.003, 39, 0.037)
    command = 15 * np.sin(time) + 5 * np.sin(2.7 * time)
    measured = np.interp(seen, time, play(command, -3.0, 5.0))
    start = 1_763_000_000
    for file, title, at, values in (
        (motor, "motor", time, command),
        (tip, "tip", seen, measured),
    ):
        stamps = [start * 10**9 + round(1e9 * each) for each in at.tolist()]
        rows = [f"{a},{b:.5f}\n" for a, b in zip(stamps, values.tolist(), strict=True)]
        file.write_text(f"stamp,{title}\n" + "".join(rows))
    columns = ["--command", "motor", "--measured", "tip", "--tip-file", str(tip)]
    out = ["--json", "--out", str(tmp_path / "out")]
    assert main(["analyze", str(motor), *columns, *out]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["dofs"][0]["width"] == pytest.approx(8, rel=0.02)
    assert found["dofs"][0]["delay"] == pytest.approx(0, abs=0.01)
    assert found["dofs"][0]["cleaning"]["interpolated"] == len(seen)


@pytest.mark.usefixtures("undrawn")
def test_cleaning_recovers_the_result_of_the_clean_record(
    record: Path, found: dict[str, Any], tmp_path: Path
) -> None:
    """Motor steps, tip in metres with an offset, uneven sampling, gaps, duplicates, late lines."""
    messy, plain = tmp_path / "messy.csv", found["models"]
    rng = np.random.default_rng(1)
    lines = []
    for text in record.read_text().splitlines()[1:]:
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
    del lines[600:620]
    messy.write_text("t,motor,tip\n" + "\n".join(lines) + "\n")
    found = analyzed(messy, tmp_path / "out")
    assert found["cleaning"]["duplicates"] >= 38
    assert found["cleaning"]["reordered"] >= 30
    assert found["cleaning"]["gaps"] == 1
    for name in ("play", "paper"):
        parameters = found["models"][name]["parameters"]
        assert parameters["gain"] == pytest.approx(-1 / 500_000, rel=0.01)
        assert 1000 * parameters["width"] == pytest.approx(8, abs=0.3)
    differing = [
        name
        for name, model in found["models"].items()
        if 1000 * model["rmse"] != pytest.approx(plain[name]["rmse"], rel=0.1, abs=0.01)
    ]
    assert differing in ([], ["last_tip"])  # the last tip is older where lines are missing


@pytest.mark.parametrize("gain", [None, "-0.9"])
@pytest.mark.usefixtures("undrawn")
def test_analyze_compares_at_horizons(
    record: Path, found: dict[str, Any], tmp_path: Path, gain: str | None
) -> None:
    if gain is not None:
        found = analyzed(record, tmp_path / "out", "--gain", gain)
    assert [horizon["share"] for horizon in found["horizons"]] == list(HORIZONS)
    counts = [horizon["sights"] for horizon in found["horizons"]]
    assert counts == sorted(counts, reverse=True)
    for name, model in found["models"].items():
        assert [horizon["share"] for horizon in model["horizons"]] == list(HORIZONS)
        alone = [horizon["rmse_command_alone"] for horizon in model["horizons"]]
        is_off_line = name in {"none", "play", "prandtl_ishlinskii", "bouc_wen"}
        assert [value is not None for value in alone] == 3 * [is_off_line], name
    last = [horizon["rmse"] for horizon in found["models"]["last_tip"]["horizons"]]
    assert last == sorted(last)
    weights = found["models"]["best"]["parameters"]["weights"]
    assert sum(weights.values()) == pytest.approx(1)


def test_a_horizon_with_too_few_sights_is_left_out(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "log.csv"
    command = np.linspace(0, 1, 200)
    lines = [f"0,{c:.5f},{2 * c:.5f}" for c in command]
    file.write_text("t,motor,tip\n" + "\n".join(lines) + "\n")
    columns = ["--command", "motor", "--measured", "tip", "--out", str(tmp_path / "out")]
    assert main(["analyze", str(file), *columns, "--json"]) == 0
    for model in json.loads(capsys.readouterr().out)["dofs"][0]["models"]:
        is_missing = [horizon["rmse"] is None for horizon in model["horizons"]]
        assert is_missing == [False, False, True], model["name"]


def test_analyze_names_an_invalid_input(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "log.csv"
    file.write_text("c,m\n1,2\n1,oops\n")
    arguments = ["analyze", str(file), "--command", "c", "--measured"]
    out = ["--out", str(tmp_path / "out")]
    assert "line 3, column m: got 'oops'" in failed(capsys, *arguments, "m", *out)
    assert "got 'm2', expected one of its columns: c" in failed(capsys, *arguments, "m2", *out)
    file.write_text("c,m\n1,2\n1,3\n")
    assert "command: got '1 throughout the first half'" in failed(capsys, *arguments, "m", *out)
    file.write_text("c,m\n" + "".join(f"{c},7\n" for c in range(9)))
    assert "measured: got '7 throughout the first half'" in failed(capsys, *arguments, "m", *out)
    # Of five samples of a sine none of the first half tells a gain.
    file.write_text("c,m\n0,0.02\n0.21,-0.01\n0.42,0.01\n0.63,0.002\n0.84,-0.01\n")
    found = failed(capsys, *arguments, "m", *out)
    assert "measured: got 'a tip that does not follow the command in the first half'" in found
    assert [path.name for path in tmp_path.iterdir()] == ["log.csv"]


@pytest.mark.usefixtures("undrawn", "three_models")
def test_a_bag_is_listed_and_analysed(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    time = np.arange(600) * 0.1
    motor = 15 * np.sin(2 * np.pi * time / 10)
    stamps = [START + round(1e9 * each) for each in time]
    topics = {
        "/motor": [(t, joint_state(t, {"m": c})) for t, c in zip(stamps, motor, strict=True)],
        "/tip": [
            (t, pose_stamped(t, (1e-3 * y, 0, 0)))
            for t, y in zip(stamps, play(motor, -3.0, 5.0), strict=True)
        ],
    }
    bag = str(write_bag(tmp_path / "bag", "mcap", topics))
    assert main(["analyze", bag]) == 0
    command = "--command /motor/m/position --measured /tip/pose/position/x"
    assert f"analyze {bag} {command}" in capsys.readouterr().out
    out = ["--json", "--out", str(tmp_path / "out")]
    assert main(["analyze", bag, *command.split(), *out]) == 0
    [dof] = json.loads(capsys.readouterr().out)["dofs"]
    assert dof["width"] == pytest.approx(8e-3, rel=0.02)
    assert "metadata.yaml: got 'no such file'" in failed(capsys, "analyze", str(tmp_path))
