"""Live cameras on FFmpeg's own test sources; DV as the article's rig gave it."""

import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from tautscope.config import CameraConfig, SourceConfig
from tautscope.errors import CameraError, MissingPathError
from tautscope.hardware.cameras import Camera, Capture, StreamClock, check_captures
from tautscope.hardware.video import Decoder, opened, read_video
from tautscope.rig import Frame

SIZE = {"width": 64, "height": 48}
PATIENCE = 60.0  # s; a loaded machine is slow, and no test waits for all of it


def camera(url: str, format_name: str | None = "lavfi", **changes: Any) -> CameraConfig:
    source = {"reconnect_period": 0.01, "start_timeout": PATIENCE, "timeout": PATIENCE}
    layout = SIZE | {
        key: changes.pop(key) for key in ("width", "height", "pixel_format") if key in changes
    }
    return CameraConfig(
        **layout, source=SourceConfig(url=url, format=format_name, **(source | changes))
    )


def pattern(more: str = "", size: str = "64x48") -> str:
    return f"testsrc2=size={size}:rate=50{more},realtime"


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def write_dv(path: Path, frames: int, pixel_format: str = "yuv420p") -> None:
    """A bright bar that moves 10 px per field. DV's second lines come first in time."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("dvvideo", rate=25)
        stream.width, stream.height, stream.pix_fmt = 720, 576, pixel_format
        for number in range(frames):
            image = np.full((576, 720, 3), 60, np.uint8)
            for line, field in ((1, 2 * number), (0, 2 * number + 1)):
                image[line::2, bar(field) : bar(field) + 40] = 200
            frame = av.VideoFrame.from_ndarray(image, format="bgr24").reformat(format=pixel_format)
            frame.pts = number
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))


def bar(field: int) -> int:
    return 20 + 10 * field


@pytest.mark.parametrize("suffix", ["dv", "avi"])
def test_interlaced_video_gives_fields_each_at_its_time(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"clip.{suffix}"
    write_dv(path, 10)
    frames = list(read_video(str(path), CameraConfig(), start=3.0))
    assert len(frames) == 20
    np.testing.assert_allclose(
        [frame.captured_at for frame in frames], 3.0 + 0.02 * np.arange(20), atol=1e-6
    )
    for field, frame in enumerate(frames):
        assert frame.sequence == field
        assert frame.image.shape == (576, 720, 3)
        for row in (100, 101, 300, 301):  # of both fields
            bright = np.flatnonzero(frame.image[row, :, 1] > 130)
            assert bright[0] == pytest.approx(bar(field), abs=1), (field, row)
            assert len(bright) == pytest.approx(40, abs=3), (field, row)
        assert frame.image.max() > 180


def test_left_interlaced_both_fields_are_in_one_frame(tmp_path: Path) -> None:
    write_dv(tmp_path / "clip.dv", 3)
    config = CameraConfig(source=SourceConfig(deinterlace="none"))
    frames = list(read_video(str(tmp_path / "clip.dv"), config))
    assert len(frames) == 3
    even, odd = (np.flatnonzero(frames[1].image[row, :, 1] > 130)[0] for row in (100, 101))
    assert (odd, even) == (pytest.approx(bar(2), abs=1), pytest.approx(bar(3), abs=1))


def test_video_in_the_wrong_size_is_named(tmp_path: Path) -> None:
    write_dv(tmp_path / "clip.dv", 2)
    with pytest.raises(CameraError, match=r"720 x 576.*640 x 480.*calibrate"):
        list(read_video(str(tmp_path / "clip.dv"), CameraConfig(width=640, height=480)))
    with pytest.raises(MissingPathError, match="a video file"):
        list(read_video(str(tmp_path / "none.avi"), CameraConfig()))
    (tmp_path / "text.avi").write_text("not a video")
    with pytest.raises(CameraError, match=r"text\.avi"):
        list(read_video(str(tmp_path / "text.avi"), CameraConfig()))


@pytest.mark.parametrize("name", ["bgr", "rgb", "bgra", "yuyv", "uyvy", "nv12", "i420"])
def test_every_pixel_format_has_the_same_colours(name: str) -> None:
    """Green, as BT.601 with limited range has it, in the layout of `tautscope.pixels`."""
    config = camera("color=0x30c040:size=64x48:rate=25,format=yuv420p", pixel_format=name)
    with opened(config.source.url, "lavfi") as container:
        image = next(iter(Decoder(container, config, live=True))).image
    y, u, v = (
        16
        + np.array(
            [[65.481, 128.553, 24.966], [-37.797, -74.203, 112.0], [112.0, -93.786, -18.214]]
        )
        @ np.array([0x30, 0xC0, 0x40])
        / 255
        + [0, 112, 112]
    )
    found = {
        "bgr": lambda: image[20, 30],
        "rgb": lambda: image[20, 30][::-1],
        "bgra": lambda: image[20, 30, :3],
        "yuyv": lambda: image[20, 30:32].ravel()[[0, 1, 3]],
        "uyvy": lambda: image[20, 30:32].ravel()[[1, 0, 2]],
        "nv12": lambda: [image[20, 30], *image[48 + 10, 30:32]],
        "i420": lambda: [
            image[20, 30],
            image[48:60].reshape(-1, 32)[10, 15],
            image[60:].reshape(-1, 32)[10, 15],
        ],
    }[name]()
    wanted = [0x40, 0xC0, 0x30] if name in ("bgr", "rgb", "bgra") else [y, u, v]
    np.testing.assert_allclose(np.asarray(found, float), wanted, atol=4)


def test_a_live_camera_gives_its_newest_frame_once() -> None:
    with Camera(camera(pattern())) as live:
        seen: list[Capture] = []

        def take() -> bool:
            capture = live.newest()
            if capture is not None:
                seen.append(capture)
            return len(seen) >= 5

        until(take)
        until(lambda: live.state.received >= seen[-1].frame.sequence + 4)
        state = live.state
    sequences = [capture.frame.sequence for capture in seen]
    assert sequences == sorted(set(sequences))
    assert state.skipped > 0
    assert state.is_interlaced is False
    assert state.trouble == ""
    for capture in seen:
        assert capture.frame.captured_at <= capture.arrived_at
        assert capture.frame.image.shape == (48, 64, 3)
    spacing = np.diff([capture.frame.captured_at for capture in seen]) / np.diff(sequences)
    assert np.median(spacing) == pytest.approx(0.02, rel=0.5)


def test_a_source_that_ends_is_opened_again_and_counts_on() -> None:
    config = camera(pattern(":duration=0.3"))
    with Camera(config) as live:
        until(lambda: live.state.reconnects >= 2 and live.state.received >= 40)
        last = live.newest()
        assert last is None or last.frame.sequence >= 15
        until(lambda: live.newest() is not None)


def test_a_camera_that_comes_later_is_found(tmp_path: Path) -> None:
    """Unplugged at first: a file that is not there yet."""
    path = tmp_path / "late.avi"
    config = CameraConfig(
        source=SourceConfig(
            url=str(path), format=None, reconnect_period=0.01, start_timeout=PATIENCE
        )
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
        ("color=black:size=64x48:rate=50,realtime", "black pictures", "is the light on"),
        ("color=red:size=64x48:rate=50,realtime", "the same picture", "frozen"),
    ],
)
def test_the_self_test_says_what_came_and_what_to_do(url: str, what: str, todo: str) -> None:
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
def test_a_camera_that_does_not_open_is_named(config: CameraConfig, what: str) -> None:
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
def test_what_waiting_does_not_mend_is_said_at_once(
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
    assert waited == [True]  # told, not timed out


def test_dv_from_a_pipe_that_pauses_is_said_and_goes_on(tmp_path: Path) -> None:
    """As `ffmpeg -f iec61883 -i auto -c copy -f dv -` writes it, by a process that stalls."""
    write_dv(tmp_path / "clip.dv", 25)
    data, pipe = (tmp_path / "clip.dv").read_bytes(), tmp_path / "pipe"
    os.mkfifo(pipe)
    source = SourceConfig(
        url=str(pipe),
        format="dv",
        timeout=0.3,
        start_timeout=PATIENCE,
        options={"probesize": "500000"},
    )
    go_on = threading.Event()

    def write() -> None:
        with suppress(BrokenPipeError), pipe.open("wb", buffering=0) as file:
            file.write(data)
            go_on.wait()
            while True:  # until nobody reads any more
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


def captures(stamps: list[float], lag: float = 0.05) -> list[Capture]:
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 255, (48, 64, 3)).astype(np.uint8) for _ in stamps]
    return [
        Capture(Frame(image, at, number), at + lag)
        for number, (image, at) in enumerate(zip(images, stamps, strict=True))
    ]


def test_stamps_of_another_clock_are_found() -> None:
    config = camera("x", clock="device")
    good = [0.02 * k for k in range(8)]
    check_captures(captures(good), config)
    with pytest.raises(CameraError, match=r"camera\.source\.clock.*captured 1e\+06 s before"):
        check_captures(captures(good, lag=1e6), config)
    with pytest.raises(CameraError, match=r"captured -0\.2 s before"):
        check_captures(captures(good, lag=-0.2), config)
    with pytest.raises(CameraError, match="run back"):
        check_captures(captures(good[::-1]), config)
    with pytest.raises(CameraError, match="3 frames in 60 s"):
        check_captures(captures(good[:3]), config)


def test_the_clock_leaves_the_jitter_of_arrival_out() -> None:
    """Frames 0.04 s apart that take 30 ms and up to 25 ms more, on a clock 1000 s off."""
    rng = np.random.default_rng(1)
    true = 0.04 * np.arange(500)
    arrived = true + 0.03 + 0.025 * rng.beta(1, 3, len(true))
    clock = StreamClock(SourceConfig(delay=0.03))
    found = np.array([clock.captured_at(t + 1000, a) for t, a in zip(true, arrived, strict=True)])
    assert np.all(found <= arrived)
    assert np.abs(found - true)[50:].max() < 1.5e-3
    naive = arrived - 0.03
    assert np.abs(found - true)[50:].max() < 0.1 * np.abs(naive - true)[50:].max()


def test_the_clock_starts_anew_where_the_stamps_jump() -> None:
    clock = StreamClock(SourceConfig())
    for k in range(5):
        clock.captured_at(0.04 * k, 100 + 0.04 * k)
    assert clock.captured_at(7000.0, 101.0) == pytest.approx(101.0)
    assert clock.captured_at(7000.04, 101.05) == pytest.approx(101.04)
    assert StreamClock(SourceConfig(clock="arrival", delay=0.1)).captured_at(5.0, 9.0) == 8.9
    assert StreamClock(SourceConfig(clock="device", delay=0.1)).captured_at(5.0, 9.0) == 4.9
    assert StreamClock(SourceConfig()).captured_at(None, 9.0) == 9.0
