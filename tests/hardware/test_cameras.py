"""Live cameras with FFmpeg's test sources, and with DV as in the article's rig."""

import os
import threading
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from tautscope.config import CameraConfig, SourceConfig
from tautscope.errors import CameraError
from tautscope.hardware.cameras import Camera, Capture
from video_sources import camera, pattern, write_dv
from waiting import TIMEOUT, until


def test_each_newest_frame_is_returned_once() -> None:
    with Camera(camera(pattern())) as live:
        captures: list[Capture] = []

        def take() -> bool:
            capture = live.newest()
            if capture is not None:
                captures.append(capture)
            return len(captures) >= 5

        until(take)
        until(lambda: live.state.received >= captures[-1].frame.sequence + 4)
        state = live.state
    sequences = [capture.frame.sequence for capture in captures]
    assert sequences == sorted(set(sequences))
    assert state.skipped > 0
    assert state.is_interlaced is False
    assert state.trouble == ""
    for capture in captures:
        assert capture.frame.captured_at <= capture.arrived_at
        assert capture.frame.image.shape == (48, 64, 3)
    spacing = np.diff([capture.frame.captured_at for capture in captures]) / np.diff(sequences)
    assert np.median(spacing) == pytest.approx(0.02, rel=0.5)


def test_source_that_ends_is_reopened() -> None:
    config = camera(pattern(":duration=0.3"))
    with Camera(config) as live:
        until(lambda: live.state.reconnects >= 2 and live.state.received >= 40)
        last = live.newest()
        assert last is None or last.frame.sequence >= 15
        until(lambda: live.newest() is not None)


def test_camera_connected_later_is_found(tmp_path: Path) -> None:
    """A file that does not exist yet simulates an unplugged camera."""
    path = tmp_path / "late.avi"
    config = CameraConfig(
        source=SourceConfig(url=str(path), format="", reconnect_period=0.01, start_timeout=TIMEOUT)
    )
    live = Camera(config)

    def plug() -> None:
        until(lambda: live.state.reconnects >= 3)
        write_dv(tmp_path / "ready.avi", 12)
        (tmp_path / "ready.avi").rename(path)

    helper = threading.Thread(target=plug)
    helper.start()
    with live:
        helper.join()
        assert live.state.is_interlaced is True
        assert live.state.reconnects >= 3


@pytest.mark.parametrize(
    ("url", "what", "todo"),
    [
        ("color=black:size=64x48:rate=50,realtime", "black images", "is the light on"),
        ("color=red:size=64x48:rate=50,realtime", "equal images", "frozen"),
    ],
)
def test_self_test_reports_cause_and_remedy(url: str, what: str, todo: str) -> None:
    with pytest.raises(CameraError, match=f"{what}.*{todo}"):
        Camera(camera(url)).open()


@pytest.mark.parametrize(
    ("config", "what"),
    [
        (camera("/dev/video99", "v4l2", start_timeout=0.5), r"/dev/video99.*is it connected"),
        (camera("nosuchfilter=1", start_timeout=0.5), "nosuchfilter"),
    ],
    ids=["missing", "source"],
)
def test_error_names_a_camera_that_does_not_open(config: CameraConfig, what: str) -> None:
    with pytest.raises(CameraError, match=what):
        Camera(config).open()


@pytest.mark.parametrize(
    ("config", "what"),
    [
        (camera(pattern(size="32x24")), r"32 x 24.*64 x 48"),
        (camera("sine=440"), "a source with a video stream"),
    ],
    ids=["size", "sound"],
)
def test_permanent_errors_are_raised_without_waiting(
    config: CameraConfig, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = Camera(config)
    waited: list[bool] = []
    wait = live._is_tested.wait
    monkeypatch.setattr(
        live._is_tested, "wait", lambda timeout: waited.append(wait(timeout)) or waited[-1]
    )
    with pytest.raises(CameraError, match=what):
        live.open()
    assert waited == [True]  # set by the error, not timed out


def test_dv_from_a_stalled_pipe_recovers(tmp_path: Path) -> None:
    """As `ffmpeg -f iec61883 -i auto -c copy -f dv -` writes it, by a process that stalls."""
    write_dv(tmp_path / "clip.dv", 25)
    data, pipe = (tmp_path / "clip.dv").read_bytes(), tmp_path / "pipe"
    os.mkfifo(pipe)
    source = SourceConfig(
        url=str(pipe),
        format="dv",
        timeout=0.3,
        start_timeout=TIMEOUT,
        options={"probesize": "500000"},
    )
    go_on = threading.Event()

    def write() -> None:
        with suppress(BrokenPipeError), pipe.open("wb", buffering=0) as file:
            file.write(data)
            go_on.wait()
            while True:  # until the reader closes the pipe
                file.write(data)

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    with Camera(CameraConfig(source=source)) as live:
        until(lambda: live.state.trouble.startswith("no frame for"))
        before = live.state
        assert before.is_interlaced is True
        assert before.age >= 0.3
        go_on.set()
        until(lambda: live.state.received > before.received and not live.state.trouble)
        assert live.state.reconnects == 0
    writer.join()
