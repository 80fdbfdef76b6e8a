"""Logs contain what was recorded, as read by tautscope and by independent readers."""

import subprocess
import sys
from dataclasses import replace
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import NonSeekingReader, make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from tautscope import extras
from tautscope.config import CameraConfig, Config, RecordingConfig
from tautscope.errors import RecordError
from tautscope.log import header, topics
from tautscope.log.alignment import align_recording
from tautscope.log.export import export_csv, export_rosbag
from tautscope.log.images import ImageCodec
from tautscope.log.reader import Update, read_log
from tautscope.log.writer import LogSummary
from tautscope.loop.frame_layout import FrameLayout
from tautscope.runs.recording import Recording, Table, per_dof

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
    for topic in (*topics.TICK_TOPICS, topics.TRUTH):
        assert counts[topic] == ticks, topic
    for topic in (*topics.UPDATE_TOPICS, topics.IMAGE):
        assert counts[topic] == frames, topic
    assert counts[topics.CONFIG] == counts[topics.RUN] == counts[topics.VERSIONS] == 1


def test_the_mcap_summary_matches_the_messages(recorded: Recorded) -> None:
    """Read with the `mcap` library's reader, which finds messages by the summary."""
    path, _, summary = recorded
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = reader.get_summary()
        assert found is not None
        assert found.statistics is not None
        assert found.statistics.message_count == sum(summary.messages.values())
        counts = found.statistics.channel_message_counts
        by_topic = {found.channels[key].topic: number for key, number in counts.items()}
        assert by_topic == summary.messages
        assert len(found.chunk_indexes) == found.statistics.chunk_count > 50
        stamps = [message.log_time for _, _, message in reader.iter_messages(log_time_order=True)]
        assert stamps == sorted(stamps)
        assert (stamps[0], stamps[-1]) == (
            found.statistics.message_start_time,
            found.statistics.message_end_time,
        )
        middle = stamps[len(stamps) // 2]
        late = sum(1 for _ in reader.iter_messages([topics.IMAGE], starting_at=middle))
    with path.open("rb") as file:
        front_to_back = NonSeekingReader(file, validate_crcs=True).iter_messages([topics.IMAGE])
        assert late == sum(message.log_time >= middle for _, _, message in front_to_back)


def test_rosbags_reads_commands_and_images(recorded: Recorded) -> None:
    path, recording, _ = recorded
    commands, images, stamps = [], [], []
    with AnyReader([path]) as reader:
        for connection, at, raw in reader.messages():
            if connection.topic == topics.COMMAND:
                message = reader.deserialize(raw, connection.msgtype)
                assert message.name == ["insertion", "rotation", "bending"]
                commands.append(message.position)
                stamps.append(at)
            if connection.topic == topics.IMAGE:
                message = reader.deserialize(raw, connection.msgtype)
                assert message.format == "bgr8; png compressed bgr8"
                images.append(cv2.imdecode(message.data, cv2.IMREAD_COLOR))
    np.testing.assert_array_equal(commands, per_dof(recording.trace, "command"))
    since_start = (np.array(stamps) - stamps[0]) / 1e9
    np.testing.assert_allclose(since_start, recording.trace["time"], atol=1e-9)
    log = read_log(path)
    seen = [index for index, event in log.events.items() if isinstance(event, Update)]
    assert len(seen) == len(images)
    for index, image in zip(seen[::20], images[::20], strict=True):
        np.testing.assert_array_equal(log.image(index), image)


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
    folder = tmp_path / 'my "bag": #1'
    export_rosbag(path, folder)
    with Reader(folder) as bag:
        assert bag.message_count == sum(summary.messages.values())
        assert bag.duration > 5e9
        counts = {name: topic.msgcount for name, topic in bag.topics.items() if topic.msgcount}
        assert counts == summary.messages
        assert sum(1 for _ in bag.messages()) == bag.message_count


@pytest.mark.parametrize("name", ["bgr", "rgb", "bgra", "yuyv", "uyvy", "nv12", "i420"])
def test_every_pixel_format_comes_back_to_the_byte(name: str) -> None:
    camera = CameraConfig(width=64, height=48, pixel_format=name)
    codec = ImageCodec(camera, RecordingConfig())
    shape = FrameLayout(camera).shape
    image = np.random.default_rng(3).integers(0, 256, shape).astype(np.uint8)
    data = codec.encode(image)
    np.testing.assert_array_equal(codec.decode(data), image)
    if name == "rgb":  # viewers show the correct colours
        seen = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
        np.testing.assert_array_equal(seen[..., ::-1], image)
    with pytest.raises(RecordError, match="no image"):
        codec.decode(data[:20])


@pytest.mark.parametrize("name", ["bgr", "rgb", "bgra", "yuyv", "uyvy", "nv12", "i420"])
def test_every_pixel_format_comes_back_from_jpeg(name: str) -> None:
    camera = CameraConfig(width=64, height=48, pixel_format=name)
    codec = ImageCodec(camera, RecordingConfig(image_format="jpeg"))
    image = np.full(FrameLayout(camera).shape, 100, np.uint8)
    found = codec.decode(codec.encode(image))
    assert found.shape == image.shape
    used = slice(None, 3) if name == "bgra" else slice(None)
    np.testing.assert_allclose(found[..., used], image[..., used], atol=3)


def test_a_log_is_written_with_any_package_of_opencv(monkeypatch: pytest.MonkeyPatch) -> None:
    def find(name: str) -> str:
        if name.startswith("opencv"):
            raise PackageNotFoundError(name)
        return "1.0"

    monkeypatch.setattr(extras, "version", find)
    versions = header.software_versions()
    assert versions["numpy"] == "1.0"
    assert versions["opencv-python-headless"] == "not installed"


def test_importing_the_package_loads_no_log_and_no_camera() -> None:
    code = (
        "import sys, tautscope, tautscope.runs.experiment, tautscope.cli;"
        "assert not {'mcap', 'av', 'zstandard'} & sys.modules.keys()"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("count", [0, 5])
def test_images_without_two_times_are_not_aligned(recorded: Recorded, count: int) -> None:
    frames = recorded[1].frames[:count].copy()
    frames["captured_at"] = 1.0  # the camera's clock stands
    with pytest.raises(RecordError, match=f"and {min(count, 1)} images"):
        align_recording(replace(recorded[1], frames=frames))
