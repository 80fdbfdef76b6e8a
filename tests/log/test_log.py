"""What is written is what was sent, and an independent reader finds all of it."""

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import IO

import cv2
import numpy as np
import pytest
from drawn import DrawnRig
from mcap.reader import NonSeekingReader, make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from tautscope.config import CameraConfig, Config, RecordingConfig
from tautscope.errors import MissingPathError, OutputError, RecordError
from tautscope.log import messages as msg
from tautscope.log.export import export_csv, export_rosbag, recover
from tautscope.log.images import ImageCodec
from tautscope.log.reader import Tick, Update, read_log
from tautscope.log.writer import LogSummary, LogWriter
from tautscope.pixels import FrameLayout
from tautscope.recording import Recording, Table, per_dof
from tautscope.reduction import HysteresisReduction
from tautscope.rig import Sample

Recorded = tuple[Path, Recording, LogSummary]


def assert_same(table: Table, other: Table) -> None:
    assert table.dtype == other.dtype
    for name in table.dtype.names or ():
        np.testing.assert_array_equal(table[name], other[name], err_msg=name)


def test_rosbags_reads_every_message_that_was_sent(recorded: Recorded) -> None:
    path, recording, summary = recorded
    counts: dict[str, int] = {}
    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            counts[connection.topic] = counts.get(connection.topic, 0) + 1
    assert counts == summary.messages
    assert summary.is_complete
    ticks, frames = len(recording.trace), len(recording.frames)
    assert (summary.ticks, summary.updates) == (ticks, frames)
    for topic in (*msg.OF_TICK, msg.TRUTH):
        assert counts[topic] == ticks, topic
    for topic in (*msg.OF_UPDATE, msg.IMAGE):
        assert counts[topic] == frames, topic
    assert counts[msg.CONFIG] == counts[msg.RUN] == counts[msg.VERSIONS] == 1


def test_the_summary_is_that_of_the_messages(recorded: Recorded) -> None:
    """As the `mcap` library's reader has it, which finds messages by the summary."""
    path, _, summary = recorded
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = reader.get_summary()
        assert found is not None
        assert found.statistics is not None
        assert found.statistics.message_count == sum(summary.messages.values())
        counts = found.statistics.channel_message_counts
        topics = {found.channels[key].topic: number for key, number in counts.items()}
        assert topics == summary.messages
        assert len(found.chunk_indexes) == found.statistics.chunk_count > 50
        stamps = [message.log_time for _, _, message in reader.iter_messages(log_time_order=True)]
        assert stamps == sorted(stamps)
        assert (stamps[0], stamps[-1]) == (
            found.statistics.message_start_time,
            found.statistics.message_end_time,
        )
        middle = stamps[len(stamps) // 2]
        late = sum(1 for _ in reader.iter_messages([msg.IMAGE], starting_at=middle))
    with path.open("rb") as file:
        front_to_back = NonSeekingReader(file, validate_crcs=True).iter_messages([msg.IMAGE])
        assert late == sum(message.log_time >= middle for _, _, message in front_to_back)


def test_rosbags_reads_what_the_run_was(recorded: Recorded) -> None:
    path, recording, _ = recorded
    commands, pictures, stamps = [], [], []
    with AnyReader([path]) as reader:
        for connection, at, raw in reader.messages():
            if connection.topic == msg.COMMAND:
                message = reader.deserialize(raw, connection.msgtype)
                assert message.name == ["insertion", "rotation", "bending"]
                commands.append(message.position)
                stamps.append(at)
            if connection.topic == msg.IMAGE:
                message = reader.deserialize(raw, connection.msgtype)
                assert message.format == "bgr8; png compressed bgr8"
                pictures.append(cv2.imdecode(message.data, cv2.IMREAD_COLOR))
    np.testing.assert_array_equal(commands, per_dof(recording.trace, "command"))
    since_start = (np.array(stamps) - stamps[0]) / 1e9
    np.testing.assert_allclose(since_start, recording.trace["time"], atol=1e-9)
    log = read_log(path)
    seen = [index for index, event in log.events.items() if isinstance(event, Update)]
    assert len(seen) == len(pictures)
    for index, picture in zip(seen[::20], pictures[::20], strict=True):
        np.testing.assert_array_equal(log.image(index), picture)


def test_a_log_reads_back_as_the_run(recorded: Recorded, config: Config) -> None:
    path, recording, _ = recorded
    log = read_log(path)
    assert not log.damage
    assert log.missing == 0
    assert log.warnings == ()
    assert log.config == config
    assert log.versions["tautscope"]
    again = log.recording()
    assert_same(again.trace, recording.trace)
    assert_same(again.frames, recording.frames)
    assert again.segments == recording.segments
    assert again.compensated


def test_csv_is_that_of_the_run(recorded: Recorded, tmp_path: Path) -> None:
    path, recording, _ = recorded
    recording.save(tmp_path / "run")
    export_csv(path, tmp_path / "log")
    for file in (tmp_path / "run").iterdir():
        assert file.read_bytes() == (tmp_path / "log" / file.name).read_bytes(), file.name


def test_a_rosbag2_folder_opens_as_one(recorded: Recorded, tmp_path: Path) -> None:
    path, _, summary = recorded
    export_rosbag(path, tmp_path / "bag")
    with Reader(tmp_path / "bag") as bag:
        assert bag.message_count == sum(summary.messages.values())
        assert bag.duration > 5e9
        counts = {name: topic.msgcount for name, topic in bag.topics.items() if topic.msgcount}
        assert counts == summary.messages
        assert sum(1 for _ in bag.messages()) == bag.message_count


def test_a_torn_log_is_read_up_to_the_tear(recorded: Recorded, tmp_path: Path) -> None:
    path, recording, _ = recorded
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    torn = tmp_path / "torn.mcap"
    before = -1
    for cut in sorted(rng.integers(20_000, len(whole), 12)):
        torn.write_bytes(whole[:cut])
        log = read_log(torn)
        assert log.damage.is_torn
        ticks = [event for event in log.events.values() if isinstance(event, Tick)]
        assert len(ticks) >= before, cut
        before = len(ticks)
        np.testing.assert_array_equal(
            [tick.command for tick in ticks], per_dof(recording.trace, "command")[: len(ticks)]
        )
        mended = tmp_path / f"{cut}.mcap"
        found = recover(torn, mended)
        assert found.damage.is_torn
        with AnyReader([mended]) as reader:
            assert sum(1 for _ in reader.messages()) == sum(found.messages.values())
        assert list(read_log(mended).events) == list(log.events)
        assert not read_log(mended).damage
    assert before > 0.9 * len(recording.trace)


def test_a_flipped_bit_costs_no_more_than_its_chunk(recorded: Recorded, tmp_path: Path) -> None:
    path, recording, _ = recorded
    whole = path.read_bytes()
    rng = np.random.default_rng(1)
    spoilt = tmp_path / "spoilt.mcap"
    for at in rng.integers(50_000, len(whole), 20):
        data = bytearray(whole)
        data[at] ^= 1 << int(rng.integers(8))
        spoilt.write_bytes(data)
        log = read_log(spoilt)
        known = {tick.sample.time: tick for tick in log.events.values() if isinstance(tick, Tick)}
        rows = np.isin(recording.trace["time"], list(known))
        np.testing.assert_array_equal(
            [tick.command for tick in known.values()], per_dof(recording.trace, "command")[rows], at
        )


def test_what_is_no_log_is_named(tmp_path: Path, recorded: Recorded) -> None:
    with pytest.raises(MissingPathError, match=r"none\.mcap.*an MCAP file"):
        read_log(tmp_path / "none.mcap")
    (tmp_path / "text.mcap").write_text("no magic at all")
    with pytest.raises(RecordError, match=r"text\.mcap.*an MCAP file"):
        read_log(tmp_path / "text.mcap")
    (tmp_path / "head.mcap").write_bytes(recorded[0].read_bytes()[:40])
    with pytest.raises(RecordError, match="a log of tautscope"):
        read_log(tmp_path / "head.mcap")
    with pytest.raises(OutputError, match="does not exist yet"):
        recover(recorded[0], recorded[0])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["head.mcap", "text.mcap"]


def test_a_log_in_the_way_is_left_alone(tmp_path: Path, config: Config) -> None:
    (tmp_path / "run.mcap").write_text("mine")
    with pytest.raises(OutputError, match="a file that does not exist yet"):
        LogWriter(tmp_path / "run.mcap", config)
    assert (tmp_path / "run.mcap").read_text() == "mine"


def test_a_full_disk_ends_the_recording_and_not_the_run(
    tmp_path: Path, config: Config, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path) -> IO[bytes]:
        return Path("/dev/full").open("wb", buffering=0)

    monkeypatch.setattr("tautscope.log.journal._open", full)
    said: list[str] = []
    log = LogWriter(tmp_path / "run.mcap", config, say=said.append)
    log._journal._thread.join()
    for tick in range(5):
        log.tick(Sample(0.01 * tick, np.zeros(3)), np.zeros(3), np.zeros(3))
    summary = log.close()
    assert "No space left" in summary.failure
    assert summary.dropped == log.dropped == 5
    assert not summary.is_complete
    (text,) = said
    assert "recording ended" in text
    assert "the run goes on" in text


def test_a_disk_that_stands_still_drops_and_says_so(tmp_path: Path, config: Config) -> None:
    """A pipe nobody reads takes 64 kB and then no more."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    small = config.replace(**{"recording.queue_events": 500, "recording.close_timeout": 0.2})
    said: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tautscope.log.journal._open", lambda path: path.open("wb", buffering=0))
        patch.setattr("tautscope.log.journal.os.fsync", lambda number: None)
        log = LogWriter(pipe, small, say=said.append)
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
    assert any("the disk did not take the rest" in text for text in said)
    os.close(reader)  # the thread's write fails, and it ends
    log._journal._thread.join()


def test_images_are_dropped_before_ticks(tmp_path: Path, config: Config) -> None:
    one = config.replace(**{"recording.queue_images": 1})
    said: list[str] = []
    rig, loop = DrawnRig(one), HysteresisReduction(one)
    sample = rig.reset()
    loop.step(sample.applied, 0.0)
    report = loop.on_frame(sample.frame)
    with LogWriter(tmp_path / "run.mcap", one, say=said.append) as log:
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
    assert any("dropped" in text for text in said)
    updates = [index for index, event in read.events.items() if isinstance(event, Update)]
    lost = next(index for index in updates if not read.has_image(index))
    with pytest.raises(RecordError, match="an update with its image"):
        read.image(lost)


@pytest.mark.parametrize("name", ["bgr", "rgb", "bgra", "yuyv", "uyvy", "nv12", "i420"])
def test_every_pixel_format_comes_back_to_the_byte(name: str) -> None:
    camera = CameraConfig(width=64, height=48, pixel_format=name)
    codec = ImageCodec(camera, RecordingConfig())
    shape = FrameLayout(camera).shape
    image = np.random.default_rng(3).integers(0, 256, shape).astype(np.uint8)
    data = codec.encode(image)
    np.testing.assert_array_equal(codec.decode(data), image)
    if name == "rgb":  # any viewer shows the colours the camera saw
        seen = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        np.testing.assert_array_equal(seen[..., ::-1], image)
    with pytest.raises(RecordError, match="no picture"):
        codec.decode(data[:20])


def test_arrays_may_be_used_again(tmp_path: Path, config: Config) -> None:
    applied, reference = np.ones(3), np.ones(3)
    with LogWriter(tmp_path / "run.mcap", config) as log:
        log.tick(Sample(0.0, applied), reference, reference)
        applied[:] = reference[:] = 7.0
    (tick,) = read_log(tmp_path / "run.mcap").events.values()
    assert isinstance(tick, Tick)
    assert tick.sample.applied.tolist() == tick.reference.tolist() == [1.0, 1.0, 1.0]


def test_a_run_that_fails_leaves_its_log_and_why(tmp_path: Path, config: Config) -> None:
    with pytest.raises(ZeroDivisionError), LogWriter(tmp_path / "run.mcap", config) as log:
        log.tick(Sample(0.0, np.zeros(3)), np.zeros(3), np.zeros(3))
        raise ZeroDivisionError("the rig fell over")
    read = read_log(tmp_path / "run.mcap")
    assert not read.damage
    assert len(read.events) == 1
    assert any("ZeroDivisionError: the rig fell over" in warning for warning in read.warnings)


def test_importing_the_package_loads_no_log_and_no_camera() -> None:
    code = (
        "import sys, tautscope, tautscope.experiment, tautscope.cli;"
        "assert not {'mcap', 'av', 'zstandard'} & sys.modules.keys()"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
