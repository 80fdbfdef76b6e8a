"""Recordings read back equal, from files and from worker processes."""

import os
import time
from pathlib import Path

import numpy as np
import pytest
from drawn import make_bad_frame_rig, make_drawn_rig, short_experiment
from tautscope.errors import (
    FrameError,
    MissingPathError,
    MotionHeldError,
    OutputError,
    RecordError,
)
from tautscope.loop.references import SineSequence
from tautscope.runs.output_folder import default_folder, new_file, new_folder, recording_saved
from tautscope.runs.recording import Recording, Table
from tautscope.runs.trials import Trial, run_trials

CONFIG = short_experiment()


def assert_same(table: Table, other: Table) -> None:
    assert table.dtype == other.dtype
    for name in table.dtype.names or ():
        np.testing.assert_array_equal(table[name], other[name], err_msg=name)


def test_the_snapshot_is_from_the_middle(compensated: Recording) -> None:
    snapshot = compensated.snapshot
    assert snapshot is not None
    half = SineSequence(CONFIG.experiment).duration / 2
    assert half - 1 < snapshot.captured_at < half + 2
    assert snapshot.image.shape == (CONFIG.camera.height, CONFIG.camera.width, 3)
    assert np.isfinite(snapshot.features).all()


def test_a_recording_reads_back_equal(compensated: Recording, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    compensated.save(folder)
    names = {path.name for path in folder.iterdir()}
    assert names == {"trace.csv", "frames.csv", "recording.toml", "config.toml"}
    again = Recording.load(folder)
    assert_same(again.trace, compensated.trace)
    assert_same(again.frames, compensated.frames)
    assert again.config == compensated.config
    assert again.segments == compensated.segments
    assert again.compensated


def test_a_folder_in_use_is_not_changed(compensated: Recording, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"out: got '.*', expected a folder that is empty"):
        compensated.save(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]


def test_a_failed_save_leaves_no_folder(
    compensated: Recording, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> str:
        raise OSError("disk full")

    monkeypatch.setattr("tautscope.runs.recording.dump_config", full)
    (tmp_path / "empty").mkdir()
    for name in ("run", "empty"):
        with pytest.raises(OutputError, match="disk full"):
            compensated.save(tmp_path / name)
    assert [each.name for each in tmp_path.rglob("*")] == ["empty"]


def test_a_recording_is_saved_behind_a_link_and_in_a_folder_that_stays(
    compensated: Recording, tmp_path: Path
) -> None:
    """A mount point cannot be replaced, nor can the working directory."""
    folder, link, ahead = (tmp_path / name for name in ("folder", "link", "ahead"))
    folder.mkdir()
    number = folder.stat().st_ino
    link.symlink_to(folder)
    ahead.symlink_to(tmp_path / "new")
    for path in (link, ahead):
        compensated.save(path)
        assert path.is_symlink()
        assert_same(Recording.load(path).trace, compensated.trace)
    assert folder.stat().st_ino == number
    assert not list(tmp_path.rglob("*.partial"))


def test_an_input_that_cannot_be_read_is_no_output(tmp_path: Path) -> None:
    name = str(tmp_path / (300 * "x"))
    with pytest.raises(OSError, match="File name too long"), new_folder(tmp_path / "run"):
        Path(name).read_text()
    with pytest.raises(OSError, match="File name too long"), new_file(tmp_path / "run"):
        Path(name).read_text()
    assert list(tmp_path.iterdir()) == []


def test_an_error_of_a_file_in_a_new_folder_names_the_folder(tmp_path: Path) -> None:
    with (
        pytest.raises(OutputError, match="disk full") as found,
        new_folder(tmp_path / "bag") as new,
        new_file(new / "bag_0.mcap"),
    ):
        raise OSError("disk full")
    assert found.value.value == str(tmp_path / "bag")


@pytest.mark.parametrize("is_new", [True, False])
def test_results_are_kept_if_the_folder_was_taken_meanwhile(is_new: bool, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    if not is_new:
        folder.mkdir()
    with (
        pytest.raises(OutputError, match="still free at the end") as found,
        new_folder(folder) as new,
    ):
        (new / "mine").write_text("results")
        folder.mkdir(exist_ok=True)
        (folder / "mine").write_text("theirs")
    assert str(new) in str(found.value)
    assert (new / "mine").read_text() == "results"
    assert (folder / "mine").read_text() == "theirs"


def test_a_file_of_two_processes_is_that_of_the_first_to_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "log.mcap"
    with pytest.raises(OutputError, match="still free at the end"), new_file(target) as mine:
        mine.write_text("first half, ")
        monkeypatch.setattr(os, "getpid", lambda: 1)
        with new_file(target) as theirs:
            theirs.write_text("theirs")
        with mine.open("a") as file:
            file.write("second half")
        assert mine.read_text() == "first half, second half"
    assert target.read_text() == "theirs"
    assert list(tmp_path.iterdir()) == [target]


def test_commands_of_one_second_have_folders_of_their_own() -> None:
    first = default_folder("analyze")
    time.sleep(0.002)
    assert default_folder("analyze") != first


def test_held_motion_is_reported_if_its_recording_cannot_be_written(
    compensated: Recording, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    error = MotionHeldError(1.0, "hold_motion", ("late_tick",))
    error.recording = compensated
    with pytest.raises(MotionHeldError) as found, recording_saved(tmp_path / "file" / "run"):
        raise error
    assert "not written" in found.value.__notes__[0]


def test_a_damaged_recording_is_named(compensated: Recording, tmp_path: Path) -> None:
    with pytest.raises(MissingPathError, match=r"recording\.toml"):
        Recording.load(tmp_path)
    folder = tmp_path / "run"
    compensated.save(folder)
    trace, frames = folder / "trace.csv", folder / "frames.csv"
    whole = trace.read_text()
    header, row, *rows = frames.read_text().splitlines()
    cells = dict(zip(header.split(","), row.split(","), strict=True)) | {"sequence": "9" * 20}
    frames.write_text("\n".join([header, ",".join(cells.values()), *rows]))
    with pytest.raises(RecordError, match=r"frames\.csv"):
        Recording.load(folder)
    for cell in ("TRUE", "1", ""):
        frames.write_text("\n".join([header, row.replace("True", cell, 1), *rows]))
        with pytest.raises(RecordError, match=rf"frames\.csv: \w+: got '{cell}', .* True or False"):
            Recording.load(folder)
    trace.write_text(whole.replace("reference_insertion", "u", 1))
    with pytest.raises(RecordError, match=r"trace\.csv.*expected the columns time"):
        Recording.load(folder)
    facts = folder / "recording.toml"
    known = facts.read_text()
    facts.write_text(known.replace("compensated = true", 'compensated = "false"'))
    with pytest.raises(RecordError, match="compensated is true or false, not 'false'"):
        Recording.load(folder)
    facts.write_text(known)
    trace.write_text(whole[: len(whole) // 2].rsplit(",", 3)[0])
    with pytest.raises(RecordError, match=r"trace\.csv"):
        Recording.load(folder)
    facts = folder / "recording.toml"
    for path, data in (
        (trace, whole.encode() + b"\xff\n"),
        (trace, whole.encode() + 200_000 * b"1"),
        (facts, b"\xff"),
        (facts, facts.read_bytes().replace(b"start = ", b"start = 'soon' # ", 1)),
    ):
        path.write_bytes(data)
        with pytest.raises(RecordError, match=path.name):
            Recording.load(folder)


def test_runs_in_worker_processes_are_identical(
    uncompensated: Recording, compensated: Recording
) -> None:
    shares: list[float] = []
    trials = [Trial(CONFIG, False), Trial(CONFIG, True)]
    first, second = run_trials(trials, shares.append, make_drawn_rig, workers=2)
    assert_same(first.trace, uncompensated.trace)
    assert_same(second.trace, compensated.trace)
    assert shares == sorted(shares)


def test_an_error_in_a_worker_process_keeps_its_facts() -> None:
    with pytest.raises(FrameError) as error:
        run_trials([Trial(CONFIG, True)] * 2, lambda share: None, make_bad_frame_rig, workers=2)
    assert error.value.allowed
