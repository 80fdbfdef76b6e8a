"""Full or slow disks and failing runs: the run goes on, and what was written can be read."""

import errno
import os
import time
from dataclasses import replace
from io import FileIO
from pathlib import Path
from typing import IO, Any

import numpy as np
import pytest
from drawn import DrawnRig
from tautscope.config import Config, axes
from tautscope.errors import EMERGENCY_STOP, FieldError, OutputError, RecordError
from tautscope.log.reader import Tick, Update, read_log
from tautscope.log.writer import LogWriter
from tautscope.loop.measurement import Tip
from tautscope.loop.reduction import HysteresisReduction
from tautscope.loop.rig import Frame, Sample


def test_an_existing_file_is_not_overwritten(tmp_path: Path, config: Config) -> None:
    (tmp_path / "run.mcap").write_text("mine")
    with pytest.raises(OutputError, match="a file that does not exist yet"):
        LogWriter(tmp_path / "run.mcap", config)
    assert (tmp_path / "run.mcap").read_text() == "mine"


def test_a_disk_that_is_full_at_the_start_is_refused(
    tmp_path: Path, config: Config, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path) -> IO[bytes]:
        path.touch()
        return Path("/dev/full").open("wb", buffering=0)

    monkeypatch.setattr("tautscope.log.journal._open", full)
    with pytest.raises(OutputError, match="No space left"):
        LogWriter(tmp_path / "run.mcap", config)
    assert not (tmp_path / "run.mcap").exists()


class FillingDisk(FileIO):
    """A file on a disk that gets full."""

    is_full = False

    def write(self, data: Any, /) -> int:
        if self.is_full:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return super().write(data)


def test_a_disk_that_gets_full_ends_the_recording_and_not_the_run(
    tmp_path: Path, config: Config, monkeypatch: pytest.MonkeyPatch
) -> None:
    disk = FillingDisk(tmp_path / "run.mcap", "xb")
    monkeypatch.setattr("tautscope.log.journal._open", lambda path: disk)
    warned: list[str] = []
    log = LogWriter(tmp_path / "run.mcap", config, on_warning=warned.append)
    disk.is_full = True
    log.tick(Sample(0.0, np.zeros(3)), np.zeros(3), np.zeros(3))
    log._journal._thread.join()
    for tick in range(1, 6):
        log.tick(Sample(0.01 * tick, np.zeros(3)), np.zeros(3), np.zeros(3))
    summary = log.close()
    assert "No space left" in summary.failure
    assert summary.dropped == log.dropped == 5
    assert not summary.is_complete
    (text,) = warned
    assert "recording ended" in text
    assert "the run goes on" in text


def test_the_header_is_written_before_the_first_tick(tmp_path: Path, config: Config) -> None:
    log = LogWriter(tmp_path / "run.mcap", config)
    (tmp_path / "killed.mcap").write_bytes((tmp_path / "run.mcap").read_bytes())
    log.close()
    assert read_log(tmp_path / "killed.mcap").config == config


def test_a_blocked_disk_drops_messages_with_a_warning(tmp_path: Path, config: Config) -> None:
    """A pipe without a reader takes 64 kB."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    small = config.replace(**{"recording.queue_events": 500, "recording.close_timeout": 0.2})
    warned: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tautscope.log.journal._open", lambda path: path.open("wb", buffering=0))
        patch.setattr("tautscope.log.journal.os.fsync", lambda number: None)
        log = LogWriter(pipe, small, on_warning=warned.append)
    rng = np.random.default_rng(2)
    ticks = 0
    while not log.dropped:
        if ticks % 400 == 0:
            time.sleep(0.3)
        noise = rng.normal(size=3)
        log.tick(Sample(0.01 * ticks, noise), noise, noise)
        ticks += 1
    summary = log.close()
    assert summary.ticks == ticks
    assert summary.dropped == 1
    assert any("the disk was too slow" in text for text in warned)
    os.close(reader)  # the write of the thread fails, and the thread ends
    log._journal._thread.join()


def test_images_are_dropped_before_ticks(tmp_path: Path, config: Config) -> None:
    one = config.replace(**{"recording.queue_images": 1})
    warned: list[str] = []
    rig, loop = DrawnRig(one), HysteresisReduction(one)
    sample = rig.reset()
    loop.step(sample.applied, 0.0)
    report = loop.on_frame(sample.frame)
    with LogWriter(tmp_path / "run.mcap", one, on_warning=warned.append) as log:
        for _ in range(200):
            log.tick(sample, sample.applied, sample.applied)
            log.frame(sample.time, sample.frame, report)
    summary = log.close()
    assert summary.dropped == 0
    assert 0 < summary.dropped_images < 200
    read = read_log(tmp_path / "run.mcap")
    assert len(read.events) == 400
    assert sum(map(read.has_image, read.events)) == 200 - summary.dropped_images
    assert any("dropped" in warning for warning in read.warnings)
    assert any("dropped" in text for text in warned)
    updates = [index for index, event in read.events.items() if isinstance(event, Update)]
    lost = next(index for index in updates if not read.has_image(index))
    with pytest.raises(RecordError, match="an update with its image"):
        read.image(lost)
    kept = next(index for index in updates if read.has_image(index))
    (tmp_path / "run.mcap").write_bytes(b"")
    with pytest.raises(RecordError, match="a file as it was when it was read"):
        read.image(kept)


@pytest.mark.parametrize("off", [1e12, 1.8e9, -1.8e9, -1e12, 1e308])
def test_a_time_that_is_far_off_is_in_the_log(tmp_path: Path, config: Config, off: float) -> None:
    """As of a rig that gives the wall clock, or nanoseconds; a stamp has a range, a number none."""
    arm = axes(3, width_limit=1.0)
    tip, frame = Tip(np.zeros(3), off), Frame(DrawnRig(config).reset().frame.image, off, 1)
    for kind, settings in (("frame", config), ("measurement", arm)):
        loop, path = HysteresisReduction(settings), tmp_path / f"{kind}.mcap"
        loop.step(np.zeros(3), 0.0)
        with LogWriter(path, settings) as log:
            for time_ in (0.0, 0.01, off):
                log.tick(Sample(time_, np.zeros(3)), np.zeros(3), np.zeros(3))
            seen, update = (frame, loop.on_frame) if kind == "frame" else (tip, loop.on_sample)
            getattr(log, kind)(0.01, seen, update(seen))
        assert log.close().is_complete
        *ticks, found = read_log(path).events.values()
        assert ticks[-1].sample.time == off
        assert found.row["captured_at"] == off


def test_images_are_lossless_while_that_is_requested(tmp_path: Path, config: Config) -> None:
    lossy = config.replace(**{"recording.image_format": "jpeg"})
    rig, loop = DrawnRig(lossy), HysteresisReduction(lossy)
    sample = rig.reset()
    loop.step(sample.applied, 0.0)
    noise = np.random.default_rng(3).integers(0, 256, sample.frame.image.shape, np.uint8)
    frame = replace(sample.frame, image=noise)
    report = loop.on_frame(frame)
    formats = ["jpeg", "png", "png", "jpeg"]
    with LogWriter(tmp_path / "run.mcap", lossy, wait=True) as log:
        for log.image_format in formats:
            log.frame(sample.time, frame, report)
    read = read_log(tmp_path / "run.mcap")
    exact = [(read.image(index) == noise).all() for index in read.events]
    assert exact == [each == "png" for each in formats]


def test_an_unknown_image_format_is_refused(tmp_path: Path, config: Config) -> None:
    with LogWriter(tmp_path / "run.mcap", config) as log:
        with pytest.raises(FieldError, match="image_format: got 'tiff', expected one of png, jpeg"):
            log.image_format = "tiff"  # type: ignore[assignment]
        assert log.image_format == "png"


def test_logged_arrays_may_be_reused(tmp_path: Path, config: Config) -> None:
    applied, reference = np.ones(3), np.ones(3)
    with LogWriter(tmp_path / "run.mcap", config) as log:
        log.tick(Sample(0.0, applied), reference, reference)
        applied[:] = reference[:] = 7.0
    (tick,) = read_log(tmp_path / "run.mcap").events.values()
    assert isinstance(tick, Tick)
    assert tick.sample.applied.tolist() == tick.reference.tolist() == [1.0, 1.0, 1.0]


def test_a_failed_run_leaves_its_log_and_the_error(tmp_path: Path, config: Config) -> None:
    with pytest.raises(ZeroDivisionError), LogWriter(tmp_path / "run.mcap", config) as log:
        log.tick(Sample(0.0, np.zeros(3)), np.zeros(3), np.zeros(3))
        error = ZeroDivisionError("the rig fell over")
        error.add_note(EMERGENCY_STOP)
        raise error
    read = read_log(tmp_path / "run.mcap")
    assert not read.damage
    assert len(read.events) == 1
    told = f"the run ended with ZeroDivisionError: the rig fell over; {EMERGENCY_STOP}"
    assert any(told in warning for warning in read.warnings)


@pytest.mark.parametrize(
    ("kind", "text"), [(KeyboardInterrupt, "interrupted"), (SystemExit, "terminated")]
)
def test_a_run_that_is_ended_by_a_signal_says_so_in_words(
    kind: type[BaseException], text: str, tmp_path: Path, config: Config
) -> None:
    with pytest.raises(kind), LogWriter(tmp_path / "run.mcap", config):
        raise kind
    assert read_log(tmp_path / "run.mcap").warnings == (f"the run was {text}",)
