"""Videos that are turned, damaged, without time stamps, or interlaced without saying so."""

import struct
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from tautscope.config import CameraConfig, SourceConfig
from tautscope.errors import CameraError
from tautscope.hardware.video import read_video
from video_sources import bar

WIDTH, HEIGHT, COUNT = 64, 48, 12
MATRICES = {90: (0, -1, 1, 0), -90: (0, 1, -1, 0), 180: (-1, 0, 0, -1)}


def images() -> list[np.ndarray]:
    """Another corner of each image is bright, so that turns differ."""
    rng = np.random.default_rng(0)
    found = [rng.integers(40, 90, (HEIGHT, WIDTH, 3), dtype=np.uint8) for _ in range(COUNT)]
    for number, image in enumerate(found):
        image[:12, : 16 + number] = 220
    return found


def write(path: Path, codec: str, pixels: str, frames: list[np.ndarray], format_name=None) -> Path:
    with av.open(str(path), "w", format=format_name) as container:
        stream = container.add_stream(codec, rate=25)
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = pixels
        for number, image in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(image, format="bgr24").reformat(format=pixels)
            frame.pts = number
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path


def camera(width: int = WIDTH, height: int = HEIGHT, **source: str) -> CameraConfig:
    return CameraConfig(width=width, height=height, source=SourceConfig(**source))


def turned(folder: Path, matrix: tuple[float, ...]) -> Path:
    """A video that players turn."""
    path = write(folder / "phone.mp4", "libx264", "yuv420p", images())
    data, (a, b, c, d) = bytearray(path.read_bytes()), (round(65536 * each) for each in matrix)
    place = (
        data.find(b"tkhd") + 44
    )  # display matrix of ISO/IEC 14496-12, 16.16 and 2.30 fixed point
    data[place : place + 36] = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    path.write_bytes(data)
    return path


def test_another_angle_is_refused(tmp_path: Path) -> None:
    half = 2**-0.5
    with pytest.raises(CameraError, match=r"turned by .?45 degrees.*multiples of 90"):
        list(read_video(str(turned(tmp_path, (half, half, -half, half))), camera()))


@pytest.mark.parametrize("angle", MATRICES)
def test_frames_are_turned_as_opencv_turns_them(tmp_path: Path, angle: int) -> None:
    path = write(tmp_path / "phone.mp4", "libx264", "yuv420p", images())
    data, (a, b, c, d) = bytearray(path.read_bytes()), MATRICES[angle]
    matrix = (
        data.find(b"tkhd") + 44
    )  # display matrix of ISO/IEC 14496-12, 16.16 and 2.30 fixed point
    one = 1 << 16
    data[matrix : matrix + 36] = struct.pack(
        ">9i", a * one, b * one, 0, c * one, d * one, 0, 0, 0, 1 << 30
    )
    path.write_bytes(data)
    size = (WIDTH, HEIGHT) if angle == 180 else (HEIGHT, WIDTH)
    frames = list(read_video(str(path), camera(*size)))
    capture = cv2.VideoCapture(str(path))
    assert len(frames) == COUNT
    for frame in frames:
        _, expected = capture.read()
        np.testing.assert_allclose(frame.image, expected, atol=2)
    if angle != 180:
        with pytest.raises(CameraError, match="images of 48 x 64"):
            list(read_video(str(path), camera()))


@pytest.mark.parametrize("damaged", [(5,), (3, 7), (0, COUNT - 1)])
def test_damaged_frames_are_left_out_and_counted(
    tmp_path: Path, damaged: tuple[int, ...], caplog: pytest.LogCaptureFixture
) -> None:
    path = write(tmp_path / "clip.avi", "mjpeg", "yuvj420p", images())
    data = bytearray(path.read_bytes())
    place = data.find(b"movi")
    for number in range(COUNT):
        place = data.find(b"00dc", place) + 8
        size = int.from_bytes(data[place - 4 : place], "little")
        if number in damaged:
            data[place : place + size] = np.random.default_rng(number).bytes(size)
        place += size
    path.write_bytes(data)
    frames = list(read_video(str(path), camera(), start=1.0))
    whole = [number for number in range(COUNT) if number not in damaged]
    expected = 1.0 + 0.04 * (np.array(whole) - whole[0])
    np.testing.assert_allclose([frame.captured_at for frame in frames], expected, atol=1e-6)
    assert f"{len(damaged)} damaged frames were left out" in caplog.text


@pytest.mark.parametrize(
    ("codec", "pixels", "name"),
    [("mjpeg", "yuvj420p", "mjpeg"), ("libx264", "yuv420p", "h264"), ("mpeg4", "yuv420p", "m4v")],
)
def test_a_raw_stream_is_refused_with_the_remedy(
    tmp_path: Path, codec: str, pixels: str, name: str
) -> None:
    path = write(tmp_path / f"clip.{name}", codec, pixels, images(), name)
    with pytest.raises(CameraError, match=r"no time stamps.*ffmpeg -r 25"):
        list(read_video(str(path), camera()))


@pytest.mark.parametrize("codec", ["ffv1", "libx264", "mjpeg"])
def test_interlaced_frames_that_are_not_marked_become_fields(tmp_path: Path, codec: str) -> None:
    """As those of `video_sources.write_dv`, but the upper field is first."""
    woven = []
    for number in range(8):
        image = np.full((96, 320, 3), 60, np.uint8)
        for line in (0, 1):
            left = bar(2 * number + line)
            image[line::2, left : left + 40] = 200
        woven.append(image)
    pixels = {"ffv1": "bgr0", "libx264": "yuv444p", "mjpeg": "yuvj444p"}[codec]
    path = write(tmp_path / "clip.mkv", codec, pixels, woven)
    assert len(list(read_video(str(path), camera(320, 96)))) == 8
    fields = list(read_video(str(path), camera(320, 96, deinterlace="always")))
    steps = np.diff([field.captured_at for field in fields])
    np.testing.assert_allclose(steps, 0.02, atol=1.1e-3)  # Matroska has whole milliseconds
    for number, field in enumerate(fields[2:-2], start=2):
        bright = np.flatnonzero(field.image[40, :, 1] > 130)
        assert bright[0] == pytest.approx(bar(number), abs=2), number
