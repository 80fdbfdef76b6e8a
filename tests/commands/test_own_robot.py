"""A newcomer's path: a rig of 2 DOFs with an EM tracker in 30 lines, and `run --rig`."""

import json
from pathlib import Path

import numpy as np
import pytest
from tautscope.cli import main
from tautscope.config import load_config
from tautscope.errors import CalibrationError
from tautscope.runs.recording import Recording

RIG = """
import numpy as np
from tautscope import Pose, Sample
from tautscope.loop.kinematics import TwoPlanes

class Catheter:
    control_period = 0.005
    def __init__(self, config):
        self.kinematics = TwoPlanes(config)
    def reset(self):
        self.ticks, self.tip = 0, np.zeros(2)
        self.noise = np.random.default_rng(1).normal
        return self.step(np.zeros(2))
    def step(self, command):
        self.tip = np.clip(self.tip, command - 0.3, command + 0.3)
        self.ticks += 1
        time, (position, rotation) = self.ticks * 0.005, self.kinematics.tip(self.tip)
        pose = Pose(position + self.noise(0, 3e-4, 3), time, rotation)
        return Sample(time, command, None, None, (pose,) if self.ticks % 5 == 0 else ())
    def close(self):
        pass
"""
ROBOT = """
[[dof]]
name = "bend_x"
width_limit = 1.0
range = [-1.5, 1.5]
[[dof]]
name = "bend_y"
width_limit = 1.0
range = [-1.5, 1.5]
[kinematics]
kind = "two_planes"
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "catheter_of_a_newcomer.py").write_text(RIG, encoding="utf-8")
    (tmp_path / "robot.toml").write_text(ROBOT, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*options: str) -> int:
    return main(["run", "--config", "robot.toml", *options])


def test_a_rig_of_thirty_lines_is_compensated(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len((RIG + ROBOT).strip().splitlines()) <= 32
    rig = ("--rig", "catheter_of_a_newcomer:Catheter")
    assert run(*rig, "--seconds", "40", "--out", "out", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert [dof["name"] for dof in found["dofs"]] == ["bend_x", "bend_y"]
    # By the estimate: the rig does not know its true tip.
    assert min(dof["reduction"] for dof in found["dofs"]) > 0.7
    recording = Recording.load(folder / "out")
    np.testing.assert_allclose(
        recording.tracking_rms(20.0), [dof["compensated_rms"] for dof in found["dofs"]]
    )
    assert load_config("out/config.toml") == load_config("robot.toml")
    assert (folder / "out" / "motion.png").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--rig", "catheter_of_a_newcomer"], "rig: got 'catheter_of_a_newcomer'"),
        (["--rig", "no_module:Rig"], "rig: got 'no_module:Rig'"),
        (["--rig", "catheter_of_a_newcomer:Nothing"], "rig: got"),
        (["--rig", "catheter_of_a_newcomer:np"], "rig: got"),
        (["--rig", "collections:OrderedDict"], "control_period"),
        (["--rig", "catheter_of_a_newcomer:Catheter", "--compare"], "--rig: got"),
        (["--seconds", "3"], "--seconds: got"),
        ([], "dof: got 'bend_x, bend_y'"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_a_wrong_rig_is_refused(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(*options) == 2
    assert message in capsys.readouterr().err


def test_a_motion_needs_a_range(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = ROBOT.replace("range = [-1.5, 1.5]\n", "", 1)
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    assert run("--rig", "catheter_of_a_newcomer:Catheter") == 2
    assert "dof[0].range" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ("(pose,)", "[pose]"),
        ("control_period = 0.005", "control_period = 0.01"),
        ("(pose,)", "(1.0,)"),
        ("command, None", "command[:1], None"),
        ("Sample(time", "Sample(float('nan')"),
        ("return Sample(time, command, None, None, ", "return (time, command, "),
    ],
)
def test_what_a_rig_returns_is_checked(
    folder: Path, change: str, field: str, capsys: pytest.CaptureFixture[str]
) -> None:
    name = f"rig_of_{folder.name}"
    (folder / f"{name}.py").write_text(RIG.replace(change, field), encoding="utf-8")
    assert run("--rig", f"{name}:Catheter", "--seconds", "2") == 2
    found = capsys.readouterr().err
    assert "error: sample" in found or "error: control.period" in found


def test_the_simulated_colonoscope_is_a_demo(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    options = ["demo", "--robot", "colonoscope", "--seconds", "30", "--out", str(out)]
    assert main(options) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in ("bend_x [rad]", "bend_y [rad]", "insertion [mm]"))
    found = json.loads((out / "results.json").read_text(encoding="utf-8"))["dofs"]
    assert [dof["unit"] for dof in found] == ["rad", "rad", "mm"]
    assert all(dof["reduction"] > 0.4 for dof in found[:2]), found


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--robot", "colonoscope", "--seeds", "2"], "--seeds: got 2"),
        (["--robot", "colonoscope", "--disturb", "smoke"], "--disturb: got 'smoke'"),
        (["--seconds", "3"], "--seconds: got 3.0"),
    ],
)
def test_options_of_the_other_demo_are_refused(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["demo", *options]) == 2
    assert message in capsys.readouterr().err


def test_the_delay_of_a_rig_is_written_into_its_configuration(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--config", "robot.toml", "--rig", "catheter_of_a_newcomer:Catheter"]
    assert main(["calibrate", "latency", *options, "--seconds", "25", "--yes", "--write"]) == 0
    assert "[measurement]" in capsys.readouterr().out
    (delay,) = load_config(folder / "robot.toml").measurement.delays
    assert delay == pytest.approx(0.005, abs=0.02)


@pytest.mark.parametrize("is_stuck", [False, True])
def test_the_kinematics_of_a_rig_is_written_or_what_the_sweep_leaves_open_is_named(
    is_stuck: bool, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name = f"stuck_{is_stuck}".lower()
    text = RIG.replace("tip(self.tip)", "tip(self.tip * [1, 0])") if is_stuck else RIG
    (folder / f"{name}.py").write_text(text, encoding="utf-8")
    toml = folder / "robot.toml"
    toml.write_text(ROBOT + "length = 0.07\n", encoding="utf-8")
    options = ["calibrate", "robot", "--config", str(toml), "--yes", "--write"]
    options += ["--rig", f"{name}:Catheter", "--seconds", "6"]
    options += [f"--keep=kinematics.{key}" for key in ("base_position", "base_rotation")]
    options += ["--keep=kinematics.sensor_rotation", "--keep=kinematics.tip_length"]
    if is_stuck:
        assert main(options) == CalibrationError.exit_status
        assert "dof.bend_y.gain" in capsys.readouterr().err
        assert load_config(toml).calibration.robot is None
        return
    assert main(options) == 0
    assert "kinematics.length was 0.07" in capsys.readouterr().out
    found = load_config(toml)
    # The rig is made with the configuration: its section is 0.07 m long.
    std = found.calibration.robot.std["kinematics.length"]
    assert found.kinematics.length == pytest.approx(0.07, abs=3 * std)
    assert 0 < std < 1e-3
    assert found.measurement.delays[0] == pytest.approx(0.005, abs=0.02)


def test_nothing_moves_without_an_answer(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("builtins.input", lambda _: "n")
    options = ["--config", str(folder / "robot.toml"), "--rig", "catheter_of_a_newcomer:Catheter"]
    assert main(["calibrate", "latency", *options]) == 2
    assert "nothing moved" in capsys.readouterr().err
