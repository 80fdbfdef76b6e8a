"""`tautscope analyze` of several degrees of freedom, and the compensator that it writes."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from play_model import play
from tautscope import figure_style
from tautscope.cli import main
from tautscope.config import load_config
from tautscope.loop.actuators import Actuators

pytestmark = pytest.mark.usefixtures("three_models")


def write_record(file: Path) -> None:
    """Two axes with slack of 8 mm and 0.5 rad behind gears and zeros, and one without."""
    rng = np.random.default_rng(0)
    time = np.arange(2000) * 0.02
    slide, turn = 15 * np.sin(0.9 * time), 2 * np.sin(0.7 * time) + np.sin(1.9 * time)
    columns = {
        "time": time,
        "motor 1 [mm]": 100 - slide / 2,
        "motor 2 [rad]": turn,
        "motor 3": slide,
        "slide [mm]": play(slide, -4, 4) - 20 + rng.normal(0, 0.05, 2000),
        "turn [deg]": np.rad2deg(play(turn, -0.25, 0.25)) + rng.normal(0, 0.3, 2000),
        "grip": slide + rng.normal(0, 0.05, 2000),
    }
    table = np.column_stack(list(columns.values()))
    np.savetxt(file, table, "%.6f", ",", header=",".join(columns), comments="")


COLUMNS = ["--command", "motor 1", "motor 2", "motor 3", "--measured", "slide", "turn", "grip"]


def test_several_degrees_of_freedom_get_a_verdict_each_and_one_loop(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(figure_style._STYLE, "savefig.dpi", 20)
    file, out = tmp_path / "log.csv", tmp_path / "out"
    write_record(file)
    assert main(["analyze", str(file), *COLUMNS, "--out", str(out), "--json", "--check"]) == 1
    found = json.loads(capsys.readouterr().out)
    slide, turn, grip = found["dofs"]
    assert [each["name"] for each in found["dofs"]] == ["slide", "turn", "grip"]
    assert (turn["command"], turn["measured"]) == ("motor 2", "turn")
    assert slide["width"] == pytest.approx(8, rel=0.03)
    assert turn["width"] == pytest.approx(np.rad2deg(0.5), rel=0.03)
    assert (grip["identified"], grip["aligned"], grip["settings"]) == (False, True, None)
    assert [line.split(":")[0] for line in found["verdict"].split("\n\n")] == [
        "slide", "turn", "grip",
    ]  # fmt: skip
    for name in ("slide", "turn", "grip"):
        written = {path.name for path in (out / name).iterdir()}
        assert written == {"analysis.csv", "analyze.png", "models.png"}

    config = load_config(out / "compensator.toml")
    assert [(dof.name, dof.unit) for dof in config.dof] == [("slide", "m"), ("turn", "rad")]
    assert config.dof[0].expected_width == pytest.approx(8e-3, rel=0.03)
    assert config.dof[1].expected_width == pytest.approx(0.5, rel=0.03)
    # A tip at -26 mm in the middle of its slack: slide = -6 mm. 0.4 rad are as the motor.
    motors = Actuators(config).motors([-26e-3, 0.4])
    np.testing.assert_allclose(motors, [103, 0.4], atol=0.03)
    low, high = config.dof[0].travel
    assert high - low == pytest.approx(30e-3 + 2 * 1.5 * 8e-3, rel=0.01)

    assert len((out / "compensator.py").read_text().splitlines()) <= 23
    run = [sys.executable, "-W", "error", str(out / "compensator.py")]
    printed = subprocess.run(run, capture_output=True, text=True, check=True).stdout
    without, compensated = (
        np.array(line.split("[")[1].strip("]").split(), float) for line in printed.splitlines()
    )
    assert without == pytest.approx([4e-3, 0.25], rel=0.2)
    assert (compensated < 0.3 * without).all()


@pytest.mark.usefixtures("undrawn")
def test_the_text_names_what_got_a_loop(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file, out = tmp_path / "log.csv", tmp_path / "out"
    write_record(file)
    columns = ["--command", "motor 1", "motor 3", "--measured", "slide", "grip"]
    assert main(["analyze", str(file), *columns, "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert f"Loop of slide: {out / 'compensator.toml'}" in text.replace("\n", " ")
    assert "No settings for grip: the slack is not identified." in text
    arguments = ["analyze", str(file), "--command", "motor 1", "--measured", "slide"]
    with pytest.raises(SystemExit, match="2"):
        main([*arguments, "grip"])
    what = "--command has 1 columns, --measured 2: one tip per actuator"
    assert what in capsys.readouterr().err
    for commands, tips in ((["motor 1", "2"], ["slide", "grip"]), (["2", "3"], ["grip", "grip"])):
        with pytest.raises(SystemExit, match="2"):
            main(["analyze", str(file), "--command", *commands, "--measured", *tips])
        assert "has a column twice: each degree of freedom has its own" in capsys.readouterr().err


@pytest.mark.usefixtures("undrawn")
def test_the_compensator_names_what_the_record_does_not_know(tmp_path: Path) -> None:
    """No unit, no time, and a tip that is late in a record with time."""
    time = np.arange(2000) * 0.02
    motor = 15 * np.sin(time)
    tip = play(15 * np.sin(time - 0.2), -3, 5)
    for title, name in (("n", "a"), ("time", "b")):
        file = tmp_path / f"{name}.csv"
        table = np.column_stack([time, motor, tip])
        np.savetxt(file, table, "%.5f", ",", header=f"{title},motor,1 tip", comments="")
        columns = ["--command", "motor", "--measured", "1 tip", "--out", str(tmp_path / name)]
        assert main(["analyze", str(file), *columns]) == 0
    texts = [(tmp_path / name / "compensator.toml").read_text() for name in ("a", "b")]
    for text in texts:
        assert (
            "names no plausible length or angle as the tip's unit: 0.001 m is 1 of axis_1" in text
        )
    assert "The record has no time: set speed" in texts[0]
    assert "measurement.delays, if time stamps are those of the record [s]: axis_1 0." in texts[1]
    assert "speed: 2 times that of the record" in texts[1]
    untimed, timed = (load_config(tmp_path / name / "compensator.toml") for name in ("a", "b"))
    assert (untimed.measurement.delays, untimed.dof[0].speed) == ((), None)
    assert timed.measurement.delays == pytest.approx([0.2], abs=0.01)
    assert 15e-3 < (timed.dof[0].speed or 0) < 60e-3  # the motor's largest speed is 15 per s
