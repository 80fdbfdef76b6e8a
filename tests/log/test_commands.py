"""The commands `tautscope recover`, `export` and `replay`."""

import csv
import json
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
from drawn import BACKLASH, with_half_images, with_periods
from recorded import record
from rosbags.highlevel import AnyReader
from tautscope.calibration.delay import DelayEstimate
from tautscope.cli import main
from tautscope.config import Config, dump_config
from tautscope.log import alignment
from tautscope.log.reader import Log, Update, read_log
from tautscope.log.writer import LogSummary, LogWriter
from tautscope.runs.recording import Recording, per_dof

Recorded = tuple[Path, Recording, LogSummary]
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def truncated(recorded: Recorded, tmp_path: Path) -> Path:
    whole = recorded[0].read_bytes()
    file = tmp_path / "truncated.mcap"
    file.write_bytes(whole[: len(whole) // 2])
    return file


def failed(capsys: Capture, *arguments: str) -> str:
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("error: ")
    return err


def write_video(file: Path, log: Log, start: float) -> None:
    """A lossless video of the frames that arrived after `start` [s], its first one at time 0."""
    updates = {
        index: float(event.row[0])
        for index, event in log.events.items()
        if isinstance(event, Update) and float(event.row[0]) > start
    }
    with av.open(str(file), "w") as container:
        stream = container.add_stream("ffv1", rate=25)
        camera = log.config.camera
        stream.width, stream.height, stream.pix_fmt = camera.width, camera.height, "bgr0"
        stream.time_base = stream.codec_context.time_base = Fraction(1, 1000)
        for index, at in updates.items():
            frame = av.VideoFrame.from_ndarray(log.image(index), format="bgr24")
            frame = frame.reformat(format="bgr0")
            frame.pts = round(1000 * (at - min(updates.values())))
            frame.time_base = stream.time_base
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def test_recover_repairs_a_truncated_log(capsys: Capture, truncated: Path) -> None:
    before = truncated.read_bytes()
    assert main(["recover", str(truncated)]) == 0
    assert "truncated-recovered.mcap:" in (output := capsys.readouterr().out)
    assert f"{truncated} is truncated" in output
    assert truncated.read_bytes() == before
    with AnyReader([truncated.with_name("truncated-recovered.mcap")]) as reader:
        assert reader.message_count > 100
    assert "does not exist yet" in failed(capsys, "recover", str(truncated))
    recovered, again = (
        str(truncated.with_name(name)) for name in ("truncated-recovered.mcap", "again.mcap")
    )
    assert main(["recover", recovered, "--out", again]) == 0
    assert "was complete" in capsys.readouterr().out


def test_export_writes_csv_and_a_bag(capsys: Capture, truncated: Path, recorded: Recorded) -> None:
    assert main(["export", str(truncated), "--csv"]) == 0
    folder = truncated.with_name("truncated-csv")
    assert str(folder) in (output := capsys.readouterr().out)
    assert f"{truncated} is truncated" in output
    trace = Recording.load(folder).trace
    np.testing.assert_array_equal(
        per_dof(trace, "command"), per_dof(recorded[1].trace, "command")[: len(trace)]
    )
    assert main(["export", str(truncated), "--rosbag", str(truncated.with_name("bag"))]) == 0
    with AnyReader([truncated.with_name("bag")]) as reader:
        assert f"{reader.message_count} messages" in (output := capsys.readouterr().out)
    assert f"{truncated} is truncated" in output
    with pytest.raises(SystemExit):
        main(["export", str(truncated)])


def test_replay_counts_identical_outputs(
    capsys: Capture, recorded: Recorded, truncated: Path, tmp_path: Path
) -> None:
    path, recording, _ = recorded
    ticks, frames = len(recording.trace), len(recording.frames)
    assert main(["replay", str(path)]) == 0
    assert capsys.readouterr().out == (
        f"{ticks} of {ticks} commands and {frames} of {frames} updates identical, bit for bit.\n"
    )
    assert main(["replay", str(truncated), "--json", "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert "warning: the log is damaged" in printed.err
    assert found["damage"]["lost_bytes"] + found["damage"]["bad_chunks"] > 0
    assert found["identical"] is True
    assert 0 < found["same_ticks"] == found["ticks"] < ticks
    assert "replay.png" in {file.name for file in (tmp_path / "out").iterdir()}


def test_a_replay_that_differs_has_status_1(
    capsys: Capture, tmp_path: Path, config: Config
) -> None:
    lossy = config.replace(**{"recording.image_format": "jpeg", "recording.jpeg_quality": 70})
    record(tmp_path / "run.mcap", lossy, 3.0)
    assert main(["replay", str(tmp_path / "run.mcap")]) == 1
    output = capsys.readouterr().out
    assert "First difference: image " in output
    assert "not lossless" in output


def test_replay_with_another_configuration_shows_its_estimates(
    capsys: Capture, recorded: Recorded, tmp_path: Path
) -> None:
    path, recording, _ = recorded
    other = tmp_path / "slow.toml"
    slow = read_log(path).config.replace(**{"insertion.smoothing_factor": 0.001})
    other.write_text(dump_config(slow))
    arguments = ["replay", str(path), "--config", str(other), "--out"]
    assert main([*arguments, str(tmp_path / "a"), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["skipped"], document["warnings"]) == (0, [])
    assert document["damage"] == {"lost_bytes": 0, "bad_chunks": 0}
    found = document["dof"]["insertion"]
    width = recording.trace["delta_plus_insertion"] - recording.trace["delta_minus_insertion"]
    assert found["recorded"]["width"] == pytest.approx(width[-1])
    assert found["replayed"]["width"] < 0.5 * width[-1]
    written = {"trace.csv", "frames.csv", "recording.toml", "config.toml", "replay.png"}
    assert {file.name for file in (tmp_path / "a").iterdir()} == written
    assert main([*arguments, str(tmp_path / "b")]) == 0
    output = capsys.readouterr().out
    assert "backlash width at the end" in output
    assert "replay.png" in output
    assert main(["replay", str(path), "--profile", "best", "--out", str(tmp_path / "c")]) == 0


def test_replay_of_a_video_and_motor_positions(
    capsys: Capture, recorded: Recorded, tmp_path: Path
) -> None:
    """A lossless video of the run's frames, with a time offset of 1000 s to the table."""
    path, recording, _ = recorded
    log = read_log(path)
    write_video(tmp_path / "clip.mkv", log, -1.0)
    with (tmp_path / "motors.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "insertion", "rotation", "bending"])
        for time, command in zip(
            recording.trace["time"], per_dof(recording.trace, "command"), strict=True
        ):
            writer.writerow([float(time) - 1000, *map(float, command)])
    video, motors, out = tmp_path / "clip.mkv", tmp_path / "motors.csv", tmp_path / "out"
    arguments = ["--video", str(video), "--motors", str(motors), "--video-start", "-1000"]
    arguments += ["--profile", log.config.profile]
    assert main(["replay", *arguments, "--out", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["images"] == pytest.approx(len(recording.frames), abs=1)
    width = recording.trace["delta_plus_insertion"] - recording.trace["delta_minus_insertion"]
    assert found["dof"]["insertion"]["replayed"]["width"] == pytest.approx(width[-1], rel=0.02)
    frames = Recording.load(out).frames
    np.testing.assert_allclose(
        frames["estimate_insertion"],
        recording.frames["estimate_insertion"][: len(frames)],
        atol=2e-4,
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, config: Config) -> tuple[Path, Recording]:
    """The whole protocol, in which each motor turns six times."""
    path = tmp_path_factory.mktemp("whole") / "run.mcap"
    recording, _ = record(path, with_half_images(with_periods(config, 3.0)))
    return path, recording


def test_align_finds_the_delay_of_a_log(
    capsys: Capture, whole: tuple[Path, Recording], recorded: Recorded
) -> None:
    """The drawn rig has no delay; the run of six seconds is too short for an answer."""
    for words in (["align"], ["calibrate", "latency"]):
        assert main([*words, str(whole[0]), "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["is_known"]
        assert found["camera_delay"] == pytest.approx(0, abs=0.03)
        assert found["drift"] == 0
    assert main(["align", str(whole[0])]) == 0
    out = capsys.readouterr().out
    assert "To correct it, set camera.source.delay = " in out
    assert "turning points:" in out
    assert main(["align", str(recorded[0]), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert not found["is_known"]
    assert found["delay"] is None
    assert main(["align", str(recorded[0])]) == 1
    assert "No answer: " in capsys.readouterr().out


@pytest.mark.parametrize(
    ("delay", "remedy"),
    [(-0.01, "camera.source.delay = 0.000"), (-0.1, "check camera.source.clock")],
)
def test_align_advises_no_delay_below_zero(
    capsys: Capture,
    recorded: Recorded,
    monkeypatch: pytest.MonkeyPatch,
    delay: float,
    remedy: str,
) -> None:
    found = DelayEstimate(delay, 0.02, 0.0, 0.0)
    monkeypatch.setattr(alignment, "align_recording", lambda *_: found)
    assert main(["align", str(recorded[0])]) == 0
    assert remedy in capsys.readouterr().out


def test_a_late_video_is_aligned(
    capsys: Capture, whole: tuple[Path, Recording], tmp_path: Path
) -> None:
    """The video begins 0.6 s after the motors, whose table is in mm and degrees."""
    path, recording = whole
    log = read_log(path)
    video, motors = tmp_path / "clip.mkv", tmp_path / "motors.csv"
    write_video(video, log, 0.59)
    positions = per_dof(recording.trace, "command") * [1e3, 180 / np.pi, 180 / np.pi]
    titles = "time,insertion_mm,rotation_deg,bending_deg"
    table = np.column_stack([recording.trace["time"], positions])
    np.savetxt(motors, table, "%.9g", delimiter=",", header=titles, comments="")
    config = tmp_path / "rig.toml"
    config.write_text(dump_config(log.config), encoding="utf-8")
    arguments = ["--video", str(video), "--motors", str(motors), "--config", str(config)]
    out = ["--out", str(tmp_path / "found"), "--json"]
    assert main(["replay", *arguments, *out]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["video_start"] == pytest.approx(0.6, abs=0.05)
    width = found["dof"]["insertion"]["replayed"]["width"]
    assert width == pytest.approx(BACKLASH[0], rel=0.1)
    given = ["--out", str(tmp_path / "given"), "--video-start", "0"]
    assert main(["replay", *arguments, *given]) == 0
    captured = capsys.readouterr()
    assert "warning: with --video-start 0 the images are 0.6" in captured.err
    assert "leave it out" in captured.err


def test_a_dof_without_motion_is_unknown(
    capsys: Capture, recorded: Recorded, tmp_path: Path
) -> None:
    """In the first six seconds insertion moves alone for four."""
    path, recording, _ = recorded
    moved = np.ptp(per_dof(recording.trace, "command"), axis=0) > 0
    out = ["--profile", "best", "--out", str(tmp_path / "found")]
    assert main(["replay", str(path), *out, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["dof"]
    assert not moved[2]
    assert found["bending"]["replayed"]["width"] is None
    assert found["insertion"]["replayed"]["width"] is not None
    assert main(["replay", str(path), "--profile", "best", "--out", str(tmp_path / "b")]) == 0
    assert "unknown" in capsys.readouterr().out


def test_csv_goes_to_the_folder_that_is_given(
    recorded: Recorded, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["export", str(recorded[0]), "--csv", "."]) == 0
    assert (tmp_path / "trace.csv").is_file()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("recover .", "log: got '.'"),
        ("export . --csv", "log: got '.'"),
        ("replay {log} --units time=ms", "--units: got 'time=ms'"),
        ("replay {log} --video-start 1", "--video-start: got 1.0"),
        ("align {log} --config article_rig", "--config: got 'article_rig'"),
        ("align --video {log} --motors one.csv", "motor positions: got '1 line'"),
        ("replay none.mcap", "log: got 'none.mcap'"),
        ("replay none.mcap --profile paper", "log: got 'no tick'"),
    ],
)
def test_input_without_use_or_content_is_refused(
    words: str,
    message: str,
    recorded: Recorded,
    capsys: Capture,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log = recorded[0]
    monkeypatch.chdir(log.parent)
    (log.parent / "one.csv").write_text("time,insertion,rotation,bending\n0,0.02,0,0\n")
    (log.parent / "none.mcap").unlink(missing_ok=True)
    LogWriter("none.mcap", Config()).close()
    before = set(log.parent.iterdir())
    assert message in failed(capsys, *words.format(log=log).split())
    assert set(log.parent.iterdir()) == before


def test_replay_rejects_unusable_input(capsys: Capture, recorded: Recorded, tmp_path: Path) -> None:
    path = str(recorded[0])
    assert "got None, expected a log" in failed(capsys, "replay")
    assert "got 'a log and --video'" in failed(capsys, "replay", path, "--video", "x.avi")
    assert "--motors: got None" in failed(capsys, "replay", "--video", "x.avi")
    assert "no.mcap" in failed(capsys, "replay", str(tmp_path / "no.mcap"))
    table = tmp_path / "m.csv"
    table.write_text("time,insertion,rotation\n0,1,2\n")
    video = ["replay", "--video", str(table), "--motors", str(table)]
    assert "got 'bending', expected one of its columns" in failed(capsys, *video)
    table.write_text("time,insertion,rotation,bending\n0,0.01,2,3\n0,0.01,2,3\n")
    assert "line 3, column time: got '0 again, as in 2 lines of 2'" in failed(capsys, *video)
    table.write_text("time,insertion,rotation,bending\n0,20,2,3\n1,30,2,3\n")
    assert "if the column is in mm, type --units insertion=mm" in failed(capsys, *video)
    table.write_text("time,insertion,rotation,bending\n0,0.01,2,3\n1,0.01,2,3\n")
    assert "m.csv" in failed(capsys, *video)  # not a video
