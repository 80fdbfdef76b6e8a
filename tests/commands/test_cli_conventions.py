"""What all commands have in common: options, exit status, messages, pipes, extras."""

import argparse
import io
import logging
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from common.paths import ROOT
from refused import failed
from tautscope.cli import _parser, main
from tautscope.commands.bench import _check_faults
from tautscope.commands.printing import announce
from tautscope.errors import (
    EMERGENCY_STOP,
    BusError,
    CameraError,
    ConfigError,
    DriveError,
    MissingExtraError,
    MotionHeldError,
    OutputError,
    StateError,
)
from tautscope.extras import MODULES, require_extras
from tautscope.runs.output_folder import new_folder

Capture = pytest.CaptureFixture[str]
COMMAND = [sys.executable, "-W", "error", "-m", "tautscope"]


def verbs() -> dict[str, argparse.ArgumentParser]:
    """Every command that does something, by its words."""
    found: dict[str, argparse.ArgumentParser] = {}

    def collect(parser: argparse.ArgumentParser, words: str) -> None:
        inner = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
        for action in inner:
            for name, each in action.choices.items():
                collect(each, f"{words} {name}".strip())
        if not inner:
            found[words] = parser

    collect(_parser(), "")
    return found


def test_the_help_of_each_command_that_takes_a_rig_says_that_it_moves() -> None:
    of_rigs = {words: each for words, each in verbs().items() if "--rig" in each.format_usage()}
    assert {"run", "jog", "doctor"} <= set(of_rigs)
    assert [words for words, each in of_rigs.items() if "MOVE" not in each.format_help()] == []


@pytest.mark.parametrize(
    ("words", "option"),
    [
        ("analyze log.csv --time t", "--time"),
        ("analyze log.csv --missing -9999", "--missing"),
        ("analyze log.csv --check", "--check"),
        ("analyze log.csv --out new", "--out"),
        ("bench --config bench_feetech --modes 8", "--modes"),
        ("calibrate all --config rig.toml --seed 3", "--seed"),
        ("calibrate all --config rig.toml --twin --seconds 20", "--seconds"),
        ("calibrate camera --board board.pdf a.png", "--board"),
        ("calibrate camera --board board.pdf --ros new", "--ros"),
        ("calibrate camera --board board.pdf --config rig.toml", "--config"),
        ("calibrate camera info.yaml --rows 8", "--rows"),
        ("calibrate camera info.yaml --twin", "--twin"),
        ("calibrate camera a.png --seconds 20", "--seconds"),
        ("calibrate camera a.png --config rig.toml", "--config"),
        ("calibrate camera --config rig.toml --seed 3", "--seed"),
        ("calibrate colour a.png --page new --twin", "--twin"),
        ("calibrate colour a.png --page new --out new", "--out"),
        ("calibrate colour log.mcap --twin", "--twin"),
        ("calibrate colour log.mcap --motors log.csv", "--motors"),
        ("calibrate colour log.mcap --video-start 3", "--video-start"),
        ("calibrate colour a.png --click 1,2 --click 3,4 --config rig.toml", "--config"),
        ("calibrate colour a.png a.png --motors log.csv", "--motors"),
        ("calibrate colour --twin --video-start 3", "--video-start"),
        ("calibrate geometry log.mcap --seed 3", "--seed"),
        ("calibrate geometry log.mcap --video-start 3", "--video-start"),
        ("calibrate geometry log.mcap --units time=ms", "--units"),
        ("calibrate colour a.png --page new --units time=ms", "--units"),
        ("doctor --yes", "--yes"),
        ("calibrate latency log.mcap --twin", "--twin"),
        ("calibrate latency log.mcap --log new", "--log"),
        ("calibrate latency log.mcap --seconds 20", "--seconds"),
        ("calibrate latency log.mcap --config rig.toml", "--config"),
        ("calibrate latency --twin --log new", "--log"),
        ("calibrate latency --twin --seconds 20", "--seconds"),
        ("calibrate latency --config rig.toml --seed 3 --yes", "--seed"),
        ("calibrate latency --rig own_catheter:Catheter --log new", "--log"),
        ("console --replay log.mcap --config rig.toml", "--config"),
        ("console --replay log.mcap --profile paper", "--profile"),
        ("console --replay log.mcap --out new", "--out"),
        ("ros2 --twin --axes 0 1 2", "--axes"),
        ("ros2 --twin --button 3", "--button"),
        ("ros2 --twin --listen tcp/127.0.0.1:7447 --connect tcp/127.0.0.1:7448", "--connect"),
        ("run --rig own_catheter:Catheter --config rig.toml --units time=ms --yes", "--units"),
    ],
)
def test_an_option_without_an_effect_is_refused(
    words: str, option: str, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("log.csv", "log.mcap", "info.yaml", "a.png"):
        Path(name).write_text("t,motor,tip\n0,1,2\n1,2,3\n")
    Path("rig.toml").write_text("")
    assert failed(capsys, *words.split()).startswith(f"error: {option}: got ")
    assert not Path("new").exists()


@pytest.mark.parametrize(
    "words", ["calibrate colour a.png --page new", "calibrate camera --board new"]
)
def test_a_file_that_the_disk_has_no_room_for_is_not_left(
    words: str, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    cv2.imwrite("a.png", np.random.default_rng(0).integers(0, 255, (60, 80, 3), np.uint8))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # half a file would break its import
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, limits[1]))
    try:
        assert "error: out: got 'new'" in failed(capsys, *words.split())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_options_have_one_meaning() -> None:
    for words, parser in verbs().items():
        options = {name for action in parser._actions for name in action.option_strings}
        assert {"-v", "--verbose", "--help"} <= options, words
        if words != "bench":  # its output is lines of JSON
            assert "--json" in options, words
        if words not in ("recover", "export", "report"):
            assert "--config" in options, words
        assert "config" not in {a.dest for a in parser._actions if not a.option_strings}, words


@pytest.mark.parametrize("words", ["demo", "config", "calibrate colour image.png mask.png"])
def test_an_unknown_option_shows_the_usage_of_its_verb(capsys: Capture, words: str) -> None:
    with pytest.raises(SystemExit) as stop:
        main([*words.split(), "--output"])
    verb, shown = words.partition(" image")[0], capsys.readouterr().err
    assert stop.value.code == 2
    assert shown.startswith(f"usage: tautscope {verb} [") and "arguments: --output" in shown


def test_errors_have_the_documented_exit_status() -> None:
    help_text = _parser().format_help()
    for error, status in (
        (ConfigError("a", 1, "b"), 2),
        (MissingExtraError("a", ("b",), ("c",)), 2),
        (BusError("a", "b", "c"), 3),
        (CameraError("a", 1, "b"), 3),
        (DriveError("a", "b", "c"), 3),
        (MotionHeldError(0.0, "hold_motion", ()), 4),
    ):
        assert error.exit_status == status
        assert re.search(rf"^  {status} ", help_text, re.MULTILINE)


def test_the_module_runs_as_a_command() -> None:
    found = subprocess.run([*COMMAND, "--version"], capture_output=True, text=True, check=True)
    assert re.fullmatch(r"tautscope \d+\.\d+\.\d+\n", found.stdout)


@pytest.mark.parametrize("arguments", [["config"], ["config", "--json"]])
def test_a_closed_pipe_is_no_traceback(arguments: list[str]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    try:
        found = subprocess.run(
            [*COMMAND, *arguments], stdout=writer, stderr=subprocess.PIPE, text=True, check=False
        )
    finally:
        os.close(writer)
    assert found.stderr == ""
    assert found.returncode == 141


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no full device")
@pytest.mark.parametrize("arguments", [["config"], ["config", "--json"]])
def test_a_full_disk_of_the_output_is_one_line(arguments: list[str]) -> None:
    with Path("/dev/full").open("w") as full:
        found = subprocess.run(
            [*COMMAND, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert found.stderr == "error: the output cannot be written: No space left on device\n"
    assert found.returncode == 2


def test_a_closed_output_is_no_traceback() -> None:
    shell = ["sh", "-c", '"$@" >&-', "sh", *COMMAND, "config"]
    found = subprocess.run(shell, capture_output=True, text=True, check=False)
    assert (found.returncode, found.stderr) == (0, "")
    shell[2] = '"$@" 2>&-'
    found = subprocess.run(
        [*shell, "--config", "nope"], capture_output=True, text=True, check=False
    )
    assert (found.returncode, found.stdout) == (2, "")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_terminated_command_leaves_no_partial_output(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, number: int
) -> None:
    def stop(*_: object) -> None:
        with new_folder(tmp_path / "out"):
            os.kill(os.getpid(), number)

    monkeypatch.setattr("tautscope.commands.config.load_config", stop)
    before = signal.signal(number, signal.SIG_DFL)  # SIGHUP is ignored below nohup.
    try:
        assert main(["config"]) == 128 + number
    finally:
        signal.signal(number, before)
    assert capsys.readouterr().err == "terminated\n"
    assert not list(tmp_path.iterdir())


def test_a_missing_file_is_named(capsys: Capture) -> None:
    columns = ["--command", "a", "--measured", "b"]
    assert "File not found: nope.csv." in failed(capsys, "analyze", "nope.csv", *columns)
    for verb in ("config", "console", "demo", "run", "doctor", "bench"):
        assert "File not found: nope.toml." in failed(capsys, verb, "--config", "nope.toml"), verb


@pytest.mark.parametrize(
    "arguments",
    [
        ["demo"],
        ["run", "--config", "bench"],
        ["console", "--twin"],
        ["analyze", "{record}", "--command", "a", "--measured", "b"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_an_output_folder_is_checked_first(
    capsys: Capture, tmp_path: Path, arguments: list[str]
) -> None:
    record = tmp_path / "record.csv"
    record.write_text("a,b\n" + "".join(f"{k % 7},{k % 7}\n" for k in range(99)))
    words = [word.format(record=record) for word in arguments]
    err = failed(capsys, *words, "--out", "/proc/nowhere/out")
    assert "out: got '/proc/nowhere/out', expected a place that can be written" in err


def test_negative_numbers_may_have_an_exponent() -> None:
    jog = ["jog", "insertion", "-1e-3", "--config", "rig.toml"]
    assert _parser().parse_args(jog).distance == -1e-3
    assert _parser().parse_args(["analyze", "a.csv", "--missing", "-1E+30"]).missing == [-1e30]


@pytest.mark.parametrize("verb", ["analyze", "replay", "report", "recover"])
def test_a_file_that_cannot_be_read_is_named(capsys: Capture, tmp_path: Path, verb: str) -> None:
    name = str(tmp_path / (300 * "x"))
    err = failed(capsys, verb, name)
    assert err.startswith(f"error: {name}")
    assert err.endswith(": File name too long\n")


def test_an_interruption_says_what_was_written(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object) -> None:
        error = KeyboardInterrupt()
        error.add_note("The log of the run is run.mcap")
        raise error

    monkeypatch.setattr("tautscope.commands.config.load_config", stop)
    assert main(["config"]) == 130
    assert capsys.readouterr().err == "interrupted\nThe log of the run is run.mcap\n"


@pytest.mark.parametrize("command", ["config", "run"])
def test_a_termination_says_that_motors_may_still_move(
    command: str, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object, **__: object) -> None:
        error = SystemExit(143)
        error.add_note(EMERGENCY_STOP)
        raise error

    monkeypatch.setattr("tautscope.commands.config.load_config", stop)
    monkeypatch.setattr("tautscope.hardware.experiment.run_on_hardware", stop)
    options = ["--config", "bench", "--yes", "--out", str(tmp_path / "run")]
    try:
        status = main([command, *(options if command == "run" else [])])
    except SystemExit as end:
        status = end.code
    assert status == 143
    err = capsys.readouterr().err
    assert err.endswith(f"{EMERGENCY_STOP}\n")
    assert "are stopped" not in err


def test_an_error_that_replaces_an_unconfirmed_stop_tells_it(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object) -> None:
        try:
            raise StateError("insertion, node 1", "quick stop is not confirmed", EMERGENCY_STOP)
        finally:
            raise KeyboardInterrupt

    monkeypatch.setattr("tautscope.commands.config.load_config", stop)
    assert main(["config"]) == 130
    told = f"insertion, node 1: quick stop is not confirmed. {EMERGENCY_STOP}"
    assert capsys.readouterr().err == f"interrupted\n{told}\n"


@pytest.mark.parametrize("note", ["The log is run.mcap", f"{EMERGENCY_STOP}: it may be moving"])
def test_an_interrupted_run_says_that_the_motors_are_stopped_only_if_they_are(
    note: str, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*_: object, **__: object) -> None:
        error = KeyboardInterrupt()
        error.add_note(note)
        raise error

    monkeypatch.setattr("tautscope.hardware.experiment.run_on_hardware", stop)
    assert main(["run", "--config", "bench", "--yes", "--out", str(tmp_path / "run")]) == 130
    found = capsys.readouterr().err
    assert note in found
    assert ("The motors are stopped" in found) == (EMERGENCY_STOP not in note)


def test_a_rig_with_placeholders_is_refused_by_name(capsys: Capture, tmp_path: Path) -> None:
    err = failed(capsys, "run", "--config", "article_rig", "--out", str(tmp_path / "run"))
    assert "drives.insertion.counts_per_unit, drives.insertion.sign" in err
    assert "placeholders of" in err
    assert list(tmp_path.iterdir()) == []


def test_a_bench_that_does_not_run_is_named(capsys: Capture, tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    bench = (ROOT / "configs" / "bench.toml").read_text(encoding="utf-8")
    file.write_text(bench.replace("/tmp/tautscope-bench", f"{tmp_path}/bench"), encoding="utf-8")
    arguments = [
        "run",
        "--config",
        str(file),
        "--out",
        str(tmp_path / "run"),
        "--periods",
        "3",
        "--yes",
    ]
    assert main(arguments) == 3
    err = capsys.readouterr().err
    assert "1 run: about 1.5 min" in err  # three DOFs, three periods of 10 s
    assert f"error: No rig answers on unix:{tmp_path}/bench.video: start `tautscope bench`" in err
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("free", [1e12, 1e6], ids=["room", "no room"])
@pytest.mark.parametrize("rig", [[], ["--rig", "tautscope.twin.colonoscope:ColonoscopeTwin"]])
def test_a_run_without_consent_or_room_for_its_log_opens_no_rig(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rig: list[str], free: float
) -> None:
    usage = shutil.disk_usage(tmp_path)._replace(free=int(free))
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage)
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))

    def opened(self: object, config: object) -> None:
        raise AssertionError("a rig was opened")

    for name in ("hardware.rig.HardwareRig", "twin.colonoscope.ColonoscopeTwin"):
        monkeypatch.setattr(f"tautscope.{name}.__init__", opened)
    config = ["--config", "colonoscope" if rig else "bench"]
    out = ["--out", str(tmp_path / "run")]
    assert main(["run", *config, *rig, *out]) == 2
    err = capsys.readouterr().err
    has_room = free == 1e12
    assert ("nothing moved" if has_room else f"out: got '{tmp_path} with") in err
    assert ("Type y to start" in err) == has_room
    assert list(tmp_path.iterdir()) == []
    if not has_room:  # consent is no room
        assert main(["run", *config, *rig, *out, "--yes"]) == 2


def test_the_room_in_a_mounted_folder_is_that_of_its_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Path] = []

    def usage(path: Path) -> SimpleNamespace:
        asked.append(path)
        return SimpleNamespace(free=2e9)

    monkeypatch.setattr(shutil, "disk_usage", usage)
    announce("a run", 1.0, 1e9, tmp_path)
    announce("a run", 1.0, 1e9, tmp_path / "new" / "folder")
    assert asked == [tmp_path, tmp_path]
    with pytest.raises(OutputError, match=f"{tmp_path} with 2 GB free"):
        announce("a run", 1.0, 3e9, tmp_path)


@pytest.mark.parametrize("fault", ["clear", "clear nothing", "drop", "drop nothing", "no camera"])
def test_a_bench_refuses_a_fault_that_it_has_not(fault: str) -> None:
    bench: Any = SimpleNamespace(drives=SimpleNamespace(kinds=("drop",)))
    _check_faults(bench, [(1.0, "drop rotation"), (2.0, "clear camera")])
    with pytest.raises(ConfigError, match=re.escape(f"--faults: got '{fault}'")):
        _check_faults(bench, [(1.0, fault)])


def test_verbose_prints_the_log(capsys: Capture, tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.touch()
    for arguments, shown in (
        (["-v", "config"], True),
        (["config", "-v"], True),
        (["config"], False),
    ):
        assert main([*arguments, "--config", str(file)]) == 0
        assert (f"info: configuration: {file}" in capsys.readouterr().err) is shown
    assert not logging.getLogger("tautscope").handlers


def test_the_shell_completes() -> None:
    """As a shell asks: the words so far in COMP_LINE, the answers on file descriptor 8."""
    line = "tautscope co"
    environment = os.environ | {
        "_ARGCOMPLETE": "1",
        "COMP_LINE": line,
        "COMP_POINT": str(len(line)),
        "_ARGCOMPLETE_IFS": "\n",
        "_ARGCOMPLETE_STDOUT_FILENAME": "/dev/stdout",
        "_ARGCOMPLETE_SUPPRESS_SPACE": "1",
    }
    found = subprocess.run(
        [sys.executable, "-m", "tautscope"], env=environment, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert found.stdout.split() == ["config", "console"]


def test_a_missing_extra_is_one_line(capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(MODULES, "twin", ("cv2", "no_such_module"))
    err = failed(capsys, "demo")
    assert err == (
        "error: tautscope demo needs no_such_module; type: "
        'python -m pip install "tautscope[twin]"\n'
    )
    with pytest.raises(ImportError, match="no_such_module"):
        require_extras("anything", ["hardware", "twin"])


def test_extras_install_the_modules_that_are_checked() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    # Large and in no group: a clone has it only by choice.
    installed = {"rerun": ["rerun-sdk"]} | packages_distributions()
    for extra, modules in MODULES.items():
        wanted = {
            re.split(r"[\[<>=]", requirement)[0].lower()
            for requirement in project["optional-dependencies"][extra]
            if not requirement.startswith("tautscope")
        }
        known = {name: {one.lower() for one in installed.get(name, [name])} for name in modules}
        for name in wanted - {"pyserial"}:
            assert any(name in names for names in known.values()), (extra, name)
        for module, names in known.items():
            own = module == "distributed" and "dask" in wanted
            assert own or names & wanted, (extra, module)


def test_without_an_input_nothing_moves(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", None)  # closed by the caller
    assert main(["jog", "insertion", "0.001", "--config", "bench"]) == 2
    assert "nothing moved" in capsys.readouterr().err
