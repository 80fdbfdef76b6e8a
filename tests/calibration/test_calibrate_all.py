"""The command `tautscope calibrate all`: sequence, resumption, report."""

import argparse
import io
import json
import os
from pathlib import Path

import pytest
from matplotlib.figure import Figure
from tautscope.calibration.geometry import sweep
from tautscope.calibration.result import CalibrationResult
from tautscope.cli import main
from tautscope.commands import calibration_session, calibration_steps, question
from tautscope.commands.calibration_rig import twin_config
from tautscope.commands.calibration_steps import Step
from tautscope.config import CameraConfig, Config, load_config
from tautscope.config.load import config_file
from tautscope.errors import CalibrationError
from tautscope.twin.drawn_rig import draw_rig

Capture = pytest.CaptureFixture[str]
COMMAND = ("calibrate", "all", "--config", "rig.toml")
SHORT = """
[twin]
frame_rate = 8.0
[experiment]
insertion.period = 7.0
rotation.period = 7.0
bending.period = 7.0
"""


class Steps:
    """Steps that finish at once; those named in `failing` raise an error."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.failing: set[str] = set()
        self.seen: list[tuple[str, float]] = []
        self.twins: list[CameraConfig] = []
        names = ("camera", "colour", "motion")
        steps = tuple(Step(name, f"The {name}", "Nothing.", self._of(name)) for name in names)
        monkeypatch.setattr(calibration_steps, "STEPS", steps)

    def _of(self, name: str):  # type: ignore[no-untyped-def]
        def run(options: argparse.Namespace, config: Config, folder: Path) -> CalibrationResult:
            self.seen.append((name, config.camera.fx))
            if options.twin:
                self.twins.append(twin_config(options, config).camera)
            if name in self.failing:
                error = CalibrationError(f"{name} failed", "Try again")
                error.add_note("A motor may still move")
                raise error
            figure = Figure()
            figure.subplots().plot([0, 1])
            if name == "motion":
                return CalibrationResult(name, {}, notes=("it moved",), figures=((figure, "F<1>"),))
            value = 400.0 + len(self.seen)
            return CalibrationResult(
                name, {"camera.fx": value}, {"camera.fx": 0.5}, 0.1, notes=(f"{name} is known",)
            )

        return run


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Steps:
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text(config_file("bench").read_text())
    return Steps(monkeypatch)


def test_an_interrupted_sequence_is_resumed(
    steps: Steps, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also from another folder."""
    steps.failing = {"colour"}
    assert main([*COMMAND, "--yes", "--out", "out"]) == 2
    assert "colour failed" in capsys.readouterr().err
    assert load_config("rig.toml").camera.fx == 401
    assert load_config("rig.toml").calibration.colour is None
    steps.failing = set()
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir("elsewhere")
    assert main([*COMMAND[:-1], "../rig.toml", "--yes", "--json"]) == 0
    monkeypatch.chdir(tmp_path)
    printed = capsys.readouterr()
    assert "Resumed; done: camera" in printed.err
    assert json.loads(printed.out) == {
        "folder": str(tmp_path / "out"),
        "done": ["camera", "colour", "motion"],
    }
    # Each step gets the configuration that the steps before have written.
    assert steps.seen == [("camera", 424), ("colour", 401), ("colour", 401), ("motion", 403)]
    config = load_config("rig.toml")
    assert config.camera.fx == 403
    assert config.calibration.camera is not None
    assert config.calibration.colour is not None
    assert config.calibration.colour.std == {"camera.fx": 0.5}
    report = Path("out/report.html").read_text()
    for text in (
        "camera is known",
        "colour is known",
        "it moved",
        "F&lt;1&gt;",
        "data:image/png",
        "<details>",
    ):
        assert text in report
    # A finished sequence is not resumed.
    assert main([*COMMAND, "--yes", "--out", "again"]) == 0
    assert len(steps.seen) == 7


def test_a_person_can_skip_repeat_and_stop(
    steps: Steps, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def answer(text: str) -> int:
        monkeypatch.setattr("sys.stdin", io.StringIO(text))
        return main(list(COMMAND))

    steps.failing = {"colour"}
    assert answer("what\ns\ny\nq\n") == 1
    err = capsys.readouterr().err
    assert "skipped" in err
    assert "error: colour failed. Try again" in err
    assert "To resume: tautscope calibrate all --config rig.toml" in err
    steps.failing = set()
    assert answer("y\n") == 1  # the input ends
    assert answer("y\n") == 0
    assert [name for name, _ in steps.seen] == ["colour", "colour", "motion"]


def test_the_terminal_answers_while_the_camera_has_the_input(
    steps: Steps, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = Path("rig.toml").read_text().replace('url = "unix:', 'url = "pipe:0" # "')
    Path("rig.toml").write_text(text)
    monkeypatch.setattr("sys.stdin", io.StringIO("video\n"))
    monkeypatch.setattr(question, "TERMINAL", tmp_path / "none")
    assert main([*COMMAND, "--out", "a"]) == 1  # nobody answers
    assert not steps.seen
    terminal = tmp_path / "terminal"
    terminal.write_text("Y\n")
    monkeypatch.setattr(question, "TERMINAL", terminal)
    assert main([*COMMAND, "--out", "b"]) == 0
    assert len(steps.seen) == 3


def test_a_step_that_fails_says_all_before_it_asks_again(
    steps: Steps, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps.failing = {"camera"}
    monkeypatch.setattr("sys.stdin", io.StringIO("y\nq\n"))
    assert main([*COMMAND, "--out", "out"]) == 1
    assert "camera failed. Try again; A motor may still move" in capsys.readouterr().err


@pytest.mark.usefixtures("steps")
def test_a_sequence_of_which_every_step_is_skipped_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO("s\ns\ns\n"))
    assert main([*COMMAND, "--out", "out"]) == 0
    assert Path("out/report.html").read_text().count("Skipped.") == 3


def test_a_step_that_fails_on_the_twin_ends_the_sequence(steps: Steps, capsys: Capture) -> None:
    steps.failing = {"colour"}
    assert main([*COMMAND, "--twin", "--out", "out"]) == 2
    assert "colour failed" in capsys.readouterr().err
    assert [name for name, _ in steps.seen] == ["camera", "colour"]
    steps.failing = set()
    assert main([*COMMAND, "--twin"]) == 0
    # All steps have the same twin, also when resumed, whatever has been written.
    assert steps.seen[-1] == ("motion", 403)
    assert steps.twins == [steps.twins[0]] * 4


def test_another_rig_and_a_damaged_state_are_refused(steps: Steps, capsys: Capture) -> None:
    steps.failing = {"colour"}
    assert main([*COMMAND, "--yes"]) == 2
    assert main([*COMMAND, "--twin", "--seed", "3"]) == 2
    assert "--restart" in capsys.readouterr().err
    assert (
        main([*COMMAND, "--twin", "--seed", "3", "--restart", "--skip", "colour", "--out", "b"])
        == 0
    )
    Path("rig.calibration.json").write_text("{}")
    assert main([*COMMAND, "--yes"]) == 2
    assert "--restart" in capsys.readouterr().err
    assert main(["calibrate", "all", "--config", "bench", "--yes"]) == 2
    assert "a file of your own" in capsys.readouterr().err
    Path("rig.toml").write_text(config_file("article_rig").read_text())
    assert main([*COMMAND, "--yes", "--restart"]) == 2
    assert "drives.insertion.travel" in capsys.readouterr().err


def test_the_twin_is_calibrated_from_camera_to_motion(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sweep.__kwdefaults__, "duration", 25.0)
    Path("rig.toml").write_text(config_file("article_rig").read_text() + SHORT)
    told = load_config("rig.toml")
    assert main([*COMMAND, "--twin", "--seed", "7", "--out", "out"]) == 0
    config, actual = load_config("rig.toml"), draw_rig(told, 7)
    for kind in ("camera", "colour", "geometry"):
        assert getattr(config.calibration, kind) is not None
    assert abs(config.camera.fx - actual.camera.fx) < 1
    assert abs(config.camera.source.delay - actual.twin.sensor.stamp_error) < 0.05
    notes = json.loads(Path("out/motion.json").read_text())["notes"]
    true = [float(note.split()[4]) for note in notes if "true remaining slack" in note]
    # Without compensation: about 10 mm, 1.8 rad and 1.1 rad.
    assert true[0] < 4
    assert true[1] < 0.6
    assert true[2] < 0.4
    assert Path("out/report.html").stat().st_size > 100_000


def test_two_processes_do_not_share_a_temporary_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, replace = tmp_path / "state.json", Path.replace

    def late(partial: Path, target: Path) -> None:
        monkeypatch.setattr(Path, "replace", replace)
        monkeypatch.setattr(os, "getpid", lambda: 1)
        calibration_session._write(file, "theirs")
        partial.replace(target)

    monkeypatch.setattr(Path, "replace", late)
    calibration_session._write(file, "mine")
    assert json.loads(file.read_text()) == "mine"
    assert list(tmp_path.iterdir()) == [file]
