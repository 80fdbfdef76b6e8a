"""A newcomer's path: a rig of 2 DOFs with an EM tracker in 30 lines, and `run --rig`."""

import io
import itertools
import json
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest
from tautscope import PlayRig, figure_style
from tautscope.cli import main
from tautscope.commands.rig_choice import choose_rig
from tautscope.config import load_config
from tautscope.errors import STOPPED, CalibrationError, ConfigError
from tautscope.hardware import jog
from tautscope.hardware.doctor import rig as rig_checks
from tautscope.log.writer import LogWriter
from tautscope.loop.kinematics import TwoPlanes
from tautscope.loop.reduction import HysteresisReduction
from tautscope.runs.recording import Recording

RIG = """
import numpy as np
from tautscope import Pose, Sample
from tautscope.log.writer import LogWriter
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


@pytest.fixture(autouse=True)
def _coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(figure_style._STYLE, "savefig.dpi", 80)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "catheter_of_a_newcomer.py").write_text(RIG, encoding="utf-8")
    (tmp_path / "robot.toml").write_text(ROBOT, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run(*options: str) -> int:
    return main(["run", "--config", "robot.toml", "--yes", *options])


def test_a_rig_of_thirty_lines_is_compensated(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len((RIG + ROBOT).strip().splitlines()) <= 32
    rig = ("--rig", "catheter_of_a_newcomer:Catheter")
    assert run(*rig, "--seconds", "20", "--out", "out", "--json") == 0
    found = json.loads(capsys.readouterr().out)
    assert found["is_tip_known"] is False
    assert list(found["dof"]) == ["bend_x", "bend_y"]
    assert min(dof["reduction"] for dof in found["dof"].values()) > 0.7
    recording = Recording.load(folder / "out")
    np.testing.assert_allclose(
        recording.tracking_rms(10.0),
        [dof["compensated_rms"] for dof in found["dof"].values()],
        rtol=0.1,  # of all ticks, the other of the measurements, few in the short crossings
    )
    assert load_config("out/config.toml") == load_config("robot.toml")
    assert (folder / "out" / "tracking.png").stat().st_size > 10_000
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert all(text in page for text in ("bend_x [rad]", "slack found", "Figures are by sensor"))
    assert "goal" not in page  # the goals are those of the article's instrument
    assert main(["report", "out", "--json", "--out", "again"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["dof"] == found["dof"]
    assert main(["replay", "out/compensated.mcap", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["same_updates"] == len(recording.frames)
    changed = (folder / "robot.toml").read_text().replace("width_limit = 1.0", "width_limit = 0.9")
    (folder / "other.toml").write_text(changed)
    options = ["--config", "other.toml", "--out", "replay"]
    assert main(["replay", "out/compensated.mcap", *options]) == 0
    assert "bend_y [rad]" in capsys.readouterr().out
    assert (folder / "replay" / "replay.png").stat().st_size > 10_000


def test_a_rig_that_fails_leaves_what_it_did(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    late = RIG.replace("        pose =", "        assert time < 1.5\n        pose =")
    (folder / "failing_rig.py").write_text(late, encoding="utf-8")
    with pytest.raises(AssertionError) as failed:
        run("--rig", "failing_rig:Catheter", "--seconds", "3", "--out", "out")
    assert failed.value.__notes__ == [
        "The log of the run is out/uncompensated.mcap: `tautscope report out/uncompensated.mcap`"
    ]
    capsys.readouterr()
    assert main(["report", "out", "--out", "again"]) == 0
    assert "bend_x: without compensation" in capsys.readouterr().out
    never = RIG.replace("return self.step(np.zeros(2))", "assert False")
    (folder / "dead_rig.py").write_text(never, encoding="utf-8")
    with pytest.raises(AssertionError):
        run("--rig", "dead_rig:Catheter", "--out", "none")
    assert not (folder / "none").exists()


@pytest.mark.parametrize(("raised", "call"), [(1, "close"), (2, "disable"), (2, "nothing")])
def test_supervisor_reaction_reaches_a_rig_in_the_same_tick(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    raised: int,
    call: str,
) -> None:
    """A second drive fault escalates to disable, of which a rig without it is closed."""
    limits = "safety.hold_time = 0.0\nsafety.hold_travel = 0.0\n"
    (folder / "robot.toml").write_text(limits + ROBOT, encoding="utf-8")
    step, ticks, calls = HysteresisReduction.step, itertools.count(1), []

    def step_with_fault(loop: HysteresisReduction, *values: Any, **more: Any) -> Any:
        if next(ticks) == 20:
            for _ in range(raised):
                loop.raise_flag("drive_fault")
        return step(loop, *values, **more)

    def called(name: str) -> Callable[[PlayRig], None]:
        return lambda rig: calls.append((name, rig.ticks))

    monkeypatch.setattr(HysteresisReduction, "step", step_with_fault)
    monkeypatch.setattr(PlayRig, "close", called("close"))
    if call != "nothing":
        monkeypatch.setattr(PlayRig, "disable", called("disable"), raising=False)
    assert run("--rig", "tautscope:PlayRig", "--out", "out") == STOPPED
    # The last command sent is that of the tick before; the reset took one.
    assert calls[0] == (call.replace("nothing", "close"), 20)
    assert next(ticks) == 21
    error = capsys.readouterr().err
    assert f"loop: {'quick_stop' if raised == 1 else 'disable'} (drive_fault)" in error
    assert f"The motors are {'without power' if call == 'disable' else 'stopped'}" in error
    assert "tautscope report out/uncompensated.mcap" in error


def test_the_motors_of_a_rig_that_fails_do_not_wait_for_the_log(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    failing = RIG.replace("        pose =", "        assert time < 0.5\n        pose =")
    text = failing.replace("        pass\n", "        print('rig closed')\n")
    (folder / "failing_motors.py").write_text(text, encoding="utf-8")
    closed: list[str] = []
    close = LogWriter.close
    monkeypatch.setattr("builtins.print", lambda *words, **_: closed.extend(map(str, words)))
    monkeypatch.setattr(LogWriter, "close", lambda log: [close(log), closed.append("log")][0])
    with pytest.raises(AssertionError):
        run("--rig", "failing_motors:Catheter", "--seconds", "3", "--out", "out")
    assert [each for each in closed if each in {"rig closed", "log"}] == ["rig closed", "log"]


def test_a_slow_disk_does_not_stop_the_steps_of_a_rig(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    keys = {"queue_events": 50, "sync_period": 0.001}
    recording = "".join(f"recording.{key} = {value}\n" for key, value in keys.items())
    unusual = f"safety.unusual = {[f'recording.{key}' for key in keys]}\n"
    (folder / "robot.toml").write_text(recording + unusual + ROBOT, encoding="utf-8")
    done, in_time = Event(), []

    def ended(rig: PlayRig) -> None:
        done.set()

    def sync(file: int) -> None:  # the disk answers when the motors are at rest again
        in_time.append(done.wait(10))

    monkeypatch.setattr(PlayRig, "close", ended)
    monkeypatch.setattr("os.fsync", sync)
    assert run("--rig", "tautscope:PlayRig", "--seconds", "2", "--out", "out") == 0
    assert all(in_time)
    assert "ticks or images are dropped" in caplog.text


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--rig", "catheter_of_a_newcomer"], "rig: got 'catheter_of_a_newcomer'"),
        (
            ["--rig", "./catheter_of_a_newcomer.py:Catheter"],
            "rig: got './catheter_of_a_newcomer.py",
        ),
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


@pytest.mark.parametrize(
    "words",
    [
        ["run", "--yes"],
        ["jog", "bend_x", "0.1", "--yes"],
        ["calibrate", "robot", "--yes"],
        ["calibrate", "latency", "--yes"],
    ],
    ids=" ".join,
)
def test_placeholders_of_a_rig_of_your_own_are_refused(
    folder: Path, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    text = ROBOT.replace("range = [-1.5, 1.5]", "range = [-1.5, 1.5] # REPLACE", 1)
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    rig = ["--config", "robot.toml", "--rig", "catheter_of_a_newcomer:Catheter"]
    assert main([*words, *rig]) == 2
    assert "dof[0].range: got 'placeholders of" in capsys.readouterr().err


@pytest.mark.usefixtures("folder")
def test_a_console_refuses_placeholders(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(ROBOT.replace("]]", "]] # REPLACE", 1), encoding="utf-8")
    options = Namespace(rig="catheter_of_a_newcomer:Catheter", config="robot.toml")
    with pytest.raises(ConfigError, match=r"dof\[0\]: got 'placeholders of"):
        choose_rig(options, in_real_time=True)


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
    options = ["demo", "--robot", "colonoscope", "--seconds", "10", "--out", str(out)]
    assert main(options) == 0
    text = capsys.readouterr().out
    assert [line.split(":")[0] for line in text.splitlines() if "of the true tip" in line] == [
        "bend_x",
        "bend_y",
        "insertion",
    ]
    found = json.loads((out / "run.json").read_text(encoding="utf-8"))["dof"]
    assert all(found[name]["reduction"] > 0.3 for name in ("bend_x", "bend_y")), found
    assert "insertion [mm]" in (out / "report.html").read_text(encoding="utf-8")


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


def test_no_delay_is_written_where_the_motors_do_not_move_the_tip(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "still.py").write_text(RIG.replace("tip(self.tip)", "tip(self.tip * 0)"))
    toml = folder / "robot.toml"
    before = toml.read_text(encoding="utf-8")
    options = ["calibrate", "latency", "--config", str(toml), "--rig", "still:Catheter"]
    assert main([*options, "--seconds", "6", "--yes", "--write"]) == CalibrationError.exit_status
    assert "does not determine measurement.delays[0]" in capsys.readouterr().err
    assert toml.read_text(encoding="utf-8") == before


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
    printed = capsys.readouterr().out
    assert "kinematics.length was 0.07" in printed
    assert "measurement.delays was not set" in printed
    assert "actuators.names was not set" in printed
    found = load_config(toml)
    # The rig is made with the configuration: its section is 0.07 m long.
    std = found.calibration.robot.std["kinematics.length"]
    assert found.kinematics.length == pytest.approx(0.07, abs=3 * std)
    assert 0 < std < 1e-3
    assert found.measurement.delays[0] == pytest.approx(0.005, abs=0.02)


WRONG = """
from tautscope import PlayRig, axes

class Wrong(PlayRig):
    def __init__(self):
        robot = axes(2, names=["bend_x", "bend_y"], width_limit=1.0)
        super().__init__(robot, gains=[-0.8, 1.15], zeros=[0.12, -0.2])
"""


@pytest.mark.parametrize("matrix", [[], [[3.0, 0.0], [0.0, -2.0], [-1.0, 2.0]]])
def test_gains_signs_and_zeros_are_right_after_one_calibration(
    matrix: list[list[float]], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The rig knows its motors by itself, the configuration has them as they were assumed."""
    name = f"wrong_{len(matrix)}"
    section = f"[actuators]\nmatrix = {matrix}\noffsets = [1, 0, 2]\n" if matrix else ""
    change = f".replace(actuators=dict(matrix={matrix}, offsets=[1, 0, 2]))" if matrix else ""
    (folder / f"{name}.py").write_text(WRONG.replace("1.0)", f"1.0){change}"), encoding="utf-8")
    robot = ROBOT.replace('[kinematics]\nkind = "two_planes"\n', section)
    (folder / "robot.toml").write_text(robot, encoding="utf-8")
    options = ["calibrate", "robot", "--config", "robot.toml", "--rig", f"{name}:Wrong", "--json"]
    options += ["--seconds", "30", "--yes", "--write"]
    assert main(options) == 0
    found = load_config("robot.toml").actuators
    assert found is not None
    assert found.names == (() if matrix else ("bend_x", "bend_y"))
    assumed = np.array(matrix or np.eye(2))
    np.testing.assert_allclose(found.matrix, assumed / [-0.8, 1.15], rtol=0.03, atol=1e-9)
    capsys.readouterr()
    assert main(options) == 0
    again = json.loads(capsys.readouterr().out)
    for k, dof in enumerate(("bend_x", "bend_y")):  # row k moves by this degree of freedom alone
        share = abs(found.matrix[k][k])
        std = again["std"][f"actuators.matrix[{k}][{k}]"] / share
        assert again["fit"][f"dof.{dof}.gain"] == pytest.approx(1.0, abs=3 * std)
        std = again["std"][f"actuators.offsets[{k}]"] / share
        assert again["fit"][f"dof.{dof}.zero"] == pytest.approx(0.0, abs=3 * std)
        assert 0 < std < 0.01


def test_a_wrong_parameter_to_keep_is_refused_before_anything_moves(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = RIG.replace("def reset(self):", "def reset(self):\n        raise SystemError")
    (folder / "rig_that_moves.py").write_text(text, encoding="utf-8")
    options = ["--config", "robot.toml", "--rig", "rig_that_moves:Catheter", "--yes"]
    assert main(["calibrate", "robot", *options, "--keep", "kinematics.lenght"]) == 2
    assert "--keep: got 'kinematics.lenght', expected dof.bend_x.zero" in capsys.readouterr().err
    with pytest.raises(SystemError):
        main(["calibrate", "robot", *options, "--keep", "kinematics.length"])


def test_nothing_moves_without_an_answer(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("n\n"))
    options = ["--config", str(folder / "robot.toml"), "--rig", "catheter_of_a_newcomer:Catheter"]
    assert main(["calibrate", "latency", *options]) == 2
    assert "nothing moved" in capsys.readouterr().err


def doctor(folder: Path, monkeypatch: pytest.MonkeyPatch, rig: str, *options: str) -> int:
    monkeypatch.setattr(rig_checks, "HOLD", 1.0)
    name = f"rig_of_{folder.name}"
    (folder / f"{name}.py").write_text(rig, encoding="utf-8")
    arguments = ["doctor", "--config", "robot.toml", "--rig", f"{name}:Catheter"]
    return main([*arguments, *options])


def test_doctor_approves_of_the_rig_of_thirty_lines(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert doctor(folder, monkeypatch, RIG, "--yes", "--json") == 0
    found = {each["what"]: each for each in json.loads(capsys.readouterr().out)["findings"]}
    assert found["sensor 0, Pose"]["data"]["rate"] == pytest.approx(40)
    assert found["clock"]["data"]["median"] == pytest.approx(0.005)
    assert found["degrees of freedom"]["status"] == "ok"
    assert {each["status"] for each in found.values()} == {"ok", "note"}
    assert found["pace"]["status"] == found["measurement.delays"]["status"] == "note"


def test_doctor_says_that_a_calibration_is_old(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    old = '[calibration.robot]\ndate = "2001-01-01T00:00:00+00:00"\n'
    (folder / "robot.toml").write_text(ROBOT + old, encoding="utf-8")
    assert doctor(folder, monkeypatch, RIG, "--yes", "--json") == 0
    found = {each["what"]: each for each in json.loads(capsys.readouterr().out)["findings"]}
    assert found["robot"]["status"] == "note"
    assert "stale" in found["robot"]["found"]


@pytest.mark.parametrize(
    "case",
    [
        ("self.ticks * 0.005", "self.ticks * 5.0", 1, "clock", "5000 ms per step"),
        (
            "Sample(time, command",
            "Sample(time, 57.3 * command + 30",
            1,
            "applied bend_x",
            "its range",
        ),
        (
            "Sample(time, command",
            "Sample(time, command + self.ticks / 400",
            1,
            "applied bend_x",
            "",
        ),
        ("Sample(time, command", "Sample(time, [0.0, 0.0, 0.0]", 1, "samples", "array (3,)"),
        ("Pose(position", "Pose(1e3 * position", 1, "sensor 0, Pose", "m and rad"),
        ("3), time", "3), time + 1.0", 1, "sensor 0, Pose", "not after it"),
        ("3), time", "3), time - 1.0", 1, "sensor 0, Pose", "safety.frame_age"),
        ("3), time", "3), time // 0.1 * 0.1", 0, "sensor 0, Pose", "once"),
        ("self.noise(0, 3e-4, 3)", "0", 0, "sensor 0, Pose", "100% repeat"),
        ("% 5 == 0", "% 60 == 0", 1, "sensor 0, Pose", "safety.frame_gap"),
        ("(pose,) if self.ticks % 5 == 0 else ()", "()", 1, "sensors", "nothing was measured"),
        ("time, rotation)", "time, 2 * rotation)", 1, "sensors", "orientation"),
        ("time, rotation)", "time)", 0, "degrees of freedom", "bend_x to 0.0"),
        ("3), time, rotation", "3) * [1, np.nan, np.nan], time", 1, "degrees of freedom", "bend_y"),
        ("self.noise(0, 3e-4, 3)", "np.nan", 1, "sensors", "position"),
    ],
)
def test_doctor_names_what_is_wrong_with_a_rig(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    case: tuple[str, str, int, str, str],
) -> None:
    change, by, status, what, found = case
    text = RIG.replace(change, by)
    assert text != RIG
    assert doctor(folder, monkeypatch, text, "--yes", "--json") == status
    every = json.loads(capsys.readouterr().out)["findings"]
    (wrong,) = (each for each in every if each["what"] == what)
    assert found in wrong["found"] + wrong["todo"], wrong
    assert wrong["status"] == ("missing" if status else "ok" if what.startswith("deg") else "note")
    assert wrong["todo"] or wrong["status"] == "ok"


def test_doctor_resets_no_rig_without_an_answer(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    text = RIG.replace("def reset(self):", "def reset(self):\n        raise SystemError")
    assert doctor(folder, monkeypatch, text) == 0
    assert "nothing moved" in capsys.readouterr().out


def test_a_jog_shows_what_the_tip_did(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(jog, "DURATION", 1.0)
    options = ["--rig", "catheter_of_a_newcomer:Catheter", "--config", "robot.toml"]
    assert main(["jog", "bend_x", "0.9", *options, "--yes", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["moved"] == pytest.approx(0.9, abs=1e-3)
    assert found["ended_at"] == pytest.approx(0.0, abs=1e-9)
    # The tip is 0.3 rad behind on the way out, and 0.3 rad ahead at the end.
    tips = [TwoPlanes(load_config("robot.toml")).tip(np.array([q, 0.0]))[0] for q in (0, 0.6, 0.3)]
    (seen,) = found["sensors"]
    assert seen["moved"] == pytest.approx(np.linalg.norm(tips[1] - tips[0]), rel=0.1)
    assert seen["ended_at"] == pytest.approx(np.linalg.norm(tips[2] - tips[0]), rel=0.1)
    assert main(["jog", "bend_x", "0.9", *options, "--yes"]) == 0
    assert "position, sensor 0: moved" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bend_z", "0.1"], "dof: got 'bend_z', expected one of bend_x, bend_y"),
        (["bend_x", "1.1"], "distance: got 1.1, expected at most 1 rad, and not 0"),
        (
            ["bend_y", "0.9"],
            "distance: got 0.9, expected within range [-0.5, 0.5] rad",
        ),
        (["bend_y", "0.1"], "answer: got 'no'"),
    ],
)
def test_a_wrong_jog_moves_nothing(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    message: str,
) -> None:
    text = "[-0.5, 0.5]".join(ROBOT.rsplit("[-1.5, 1.5]", 1))
    (folder / "robot.toml").write_text(text, encoding="utf-8")
    monkeypatch.setattr("sys.stdin", io.StringIO("n" if "answer" in message else "y"))
    options = ["--rig", "catheter_of_a_newcomer:Catheter", "--config", "robot.toml"]
    assert main(["jog", *arguments, *options]) == 2
    assert message in capsys.readouterr().err
