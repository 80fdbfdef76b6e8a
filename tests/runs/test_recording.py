"""Recordings read back equal, from files and from worker processes."""

from pathlib import Path

import numpy as np
import pytest
from drawn import make_bad_frame_rig, make_drawn_rig, short_experiment
from tautscope.errors import (
    FrameError,
    MissingPathError,
    OutputError,
    RecordError,
)
from tautscope.loop.references import SineSequence
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
    with pytest.raises(OSError, match="disk full"):
        compensated.save(tmp_path / "run")
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_recording_is_named(compensated: Recording, tmp_path: Path) -> None:
    with pytest.raises(MissingPathError, match=r"recording\.toml"):
        Recording.load(tmp_path)
    folder = tmp_path / "run"
    compensated.save(folder)
    trace = folder / "trace.csv"
    whole = trace.read_text()
    trace.write_text(whole.replace("reference_insertion", "u", 1))
    with pytest.raises(RecordError, match=r"trace\.csv.*expected the columns time"):
        Recording.load(folder)
    trace.write_text(whole[: len(whole) // 2].rsplit(",", 3)[0])
    with pytest.raises(RecordError, match=r"trace\.csv"):
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
