"""The command `tautscope jog`, on simulated drives."""

import io
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from drive_settings import drives_document
from refused import failed
from tautscope.bench.can_bus import Hub
from tautscope.bench.drives import SimulatedDrives
from tautscope.cli import main
from tautscope.config import dump_config, from_document
from tautscope.dof import Dof
from tautscope.hardware import jog

Bench = Callable[..., SimulatedDrives]


@pytest.fixture
def rig(hub: Hub, tmp_path: Path) -> str:
    """The file of a rig with the bus `hub`."""
    file = tmp_path / "rig.toml"
    document = {"drives": drives_document(channel=str(hub.path))}
    file.write_text(dump_config(from_document(document)), encoding="utf-8")
    return str(file)


def test_a_jog_goes_as_far_as_told_and_comes_back(
    rig: str, bench: Bench, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    drives = from_document({"drives": drives_document(channel="unused")}).drives
    bench(drives)
    monkeypatch.setattr(jog, "DURATION", 1.0)
    assert main(["jog", "insertion", "0.001", "--config", rig, "--yes", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["dof"] == "insertion"
    assert found["moved"] == pytest.approx(1e-3, abs=1e-5)
    assert found["ended_at"] == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize("distance", ["0.0021", "-0.0021", "0", "nan"])
def test_a_distance_beyond_the_limit_is_refused(
    rig: str, capsys: pytest.CaptureFixture[str], distance: str
) -> None:
    err = failed(capsys, "jog", "--config", rig, "insertion", distance)
    assert "expected at most 0.002 m, and not 0" in err


def test_the_question_has_a_unit(
    rig: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for dof, distance, shown in (("insertion", "0.001", "1 mm"), ("rotation", "-0.1", "-0.1 rad")):
        monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
        assert main(["jog", "--config", rig, dof, distance]) == 2
        assert f"{dof} will move by {shown} and back" in capsys.readouterr().err


def test_nothing_moves_without_a_yes(
    rig: str, bench: Bench, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    drives = bench(from_document({"drives": drives_document(channel="unused")}).drives)
    monkeypatch.setattr("sys.stdin", io.StringIO("\n"))
    assert main(["jog", "rotation", "0.1", "--config", rig]) == 2
    assert "nothing moved" in capsys.readouterr().err
    assert not any(event.what == "operation enabled" for event in drives.events)


def test_faults_are_reset_only_if_told(
    rig: str, bench: Bench, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    drives = bench(from_document({"drives": drives_document(channel="unused")}).drives)
    monkeypatch.setattr(jog, "DURATION", 1.0)
    drives.inject("fault", Dof.INSERTION)
    drives.clear(Dof.INSERTION)
    command = ["jog", "rotation", "0.1", "--config", rig, "--yes"]
    assert main(command) == 3
    assert "jog with --reset-faults" in capsys.readouterr().err
    assert not any(event.what == "operation enabled" for event in drives.events)
    assert main([*command, "--reset-faults"]) == 0


def test_placeholders_of_the_drives_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    err = failed(capsys, "jog", "--config", "article_rig", "insertion", "0.001", "--yes")
    assert "drives.insertion.counts_per_unit" in err
    assert "without the word REPLACE" in err


def test_a_rig_that_does_not_answer_refuses(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = tmp_path / "rig.toml"
    nobody = str(tmp_path / "nobody")
    document = {"drives": drives_document(channel=nobody)}
    file.write_text(dump_config(from_document(document)), encoding="utf-8")
    assert main(["jog", "rotation", "0.1", "--config", str(file), "--yes"]) == 3
    err = capsys.readouterr().err
    assert err == (
        f"error: CAN bus: no rig answers on {nobody}. Start `tautscope bench`, or check "
        "drives.channel\n"
    )
